"""Make the report of a flight whose worlds ran in containers of their own: report.py SCENARIO FOLDER, in the ROS 1 world."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from alula_flight.report.facts import RunFacts
from alula_flight.report.making import make_report
from alula_flight.verdict import verdict_lines


def main(scenario: str, folder: Path) -> None:
    """Write the report into the folder and say how the flight went."""
    faults = [word for word in os.environ.get("FAIL", "").split(",") if word]
    seed = int(os.environ.get("SEED", "0"))
    summary = make_report(RunFacts(scenario=scenario, seed=seed, out_dir=folder, faults=faults, died=[], mission_exit=None))
    sys.stdout.write("\n".join(verdict_lines(summary, [], folder)) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
