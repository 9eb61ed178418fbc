"""``python3 -m alula.report FOLDER --scenario NAME``: the report of a run that no supervisor has watched.

The folder holds what a flight leaves whose worlds ran apart; with ``--of RUN`` what a replay leaves: ``skills.mcap`` and
``run_log.jsonl``. The verdict is on stdout. Ends with 0; what can't be made is named in the summary's ``problems``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.report.facts import RunFacts
from alula.report.making import make_report
from alula.report.verdict import verdict_lines


def main(words: Sequence[str] | None = None) -> int:
    """Make the report; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula.report", description="Make summary, pictures and page of a run.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--seed", type=int, help="seed of the run, if known")
    parser.add_argument("--of", default="", metavar="RUN", help="for a replay: name of the recorded run")
    parser.add_argument(
        "--fail", action="append", default=[], help="a fault of the run; for a replay, a fault that the recorded run did not have"
    )
    given = parser.parse_args(words)
    facts = RunFacts(given.scenario, given.seed, given.folder, given.fail, (), None, mock=bool(given.of), replay_of=given.of)
    sys.stdout.write("\n".join(verdict_lines(make_report(facts), (), given.folder)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
