"""``python3 -m alula_flight.report FOLDER --of RUN [--fail ...]``: the report of a replay, as of a flight over mocks.

The folder holds what a replay leaves: ``skills.mcap``, ``mission.json``, ``mock.json``. Ends with 0; what can't be made is named in
the summary's ``problems``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from alula_flight.report.facts import RunFacts
from alula_flight.report.making import make_report


def main(words: Sequence[str] | None = None) -> int:
    """Make the report; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula_flight.report", description="Make summary, pictures and page of a replay.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--of", required=True, metavar="RUN", help="the name of the run whose decisions were made again")
    parser.add_argument("--fail", action="append", default=[], help="what did not fail then")
    given = parser.parse_args(words)
    facts = RunFacts(given.scenario, None, given.folder, given.fail, (), None, mock=True, replay_of=given.of)
    make_report(facts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
