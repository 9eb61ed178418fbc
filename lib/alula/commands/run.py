"""``alula run SCENARIO --mock``: run a mission over mocks, in virtual time, and make its report. It needs no ROS and nothing generated.

Ends with 0 (accomplished, also when degraded), 1 (given up or aborted), 2 (could not start; then nothing is written).
"""

from __future__ import annotations

import argparse
import signal
import sys
import uuid
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from alula.campaign import mock_run
from alula.common.faults import FaultError
from alula.common.files import write_json
from alula.common.robots import RobotError
from alula.common.runs import runs_folder
from alula.common.scenarios import ScenarioError, scenario_names
from alula.missions.director import EXIT_CODES, Outcome
from alula.missions.plan import InputError
from alula.records.conformance import Monitor
from alula.records.errors import AnalysisError
from alula.records.models import models_of
from alula.report.facts import RunFacts
from alula.report.live import LiveEvents
from alula.report.making import make_report
from alula.report.verdict import verdict_lines

CANNOT_START = EXIT_CODES[Outcome.NOT_STARTED]


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="alula run", description="Run a scenario of the robot over mocks, in virtual time.")
    parser.add_argument("scenario", help="one of the robot's")
    parser.add_argument("--mock", action="store_true", help="over mocks; other runs need an installation with ROS (./alula setup)")
    parser.add_argument("--fail", action="append", default=[], metavar="WHAT[:HOW][@SECONDS[-SECONDS]]", help="a fault of the mocks")
    parser.add_argument("--world", default="", metavar="FILE|NAME", help="where the mission's inputs come from (default: the scenario's)")
    parser.add_argument("--behaviour", type=Path, action="append", default=[], metavar="FILE", help="of the mocks, on top of the robot's")
    parser.add_argument("--seed", type=int, default=0, help="seed of the mocks' chance (default 0)")
    parser.add_argument("--out", type=Path, help="folder for the results (default: runs/TIME-SCENARIO of the robot)")
    parser.add_argument("--monitor", action="store_true", help="hold every event against the models")
    given = parser.parse_args(words)
    if not given.mock:
        known = ", ".join(scenario_names())
        parser.error(f"without --mock a run needs an installation with ROS (./alula setup of a checkout); there are {known}")
    return given


def run_folder(wanted: Path | None, scenario: str) -> Path:
    """Return an absolute path that holds no run yet; raises AnalysisError where the wanted one does."""
    if wanted is not None:
        folder = wanted.expanduser().absolute()
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise AnalysisError(f"--out {wanted}: exists and is not an empty folder; choose another, a run never overwrites")
        return folder
    base = runs_folder().absolute() / f"{datetime.now(tz=UTC).astimezone():%Y%m%d-%H%M%S}-{scenario}"
    candidates = (base, *(base.with_name(f"{base.name}-{n}") for n in range(2, 1000)))
    return next(folder for folder in candidates if not folder.exists())


def run(given: argparse.Namespace) -> int:
    """Run and report; return the exit code.

    Raises:
        AnalysisError, FaultError, RobotError, ScenarioError, InputError: it can't be run; nothing was written.
    """
    out = given.out = run_folder(given.out, given.scenario)
    mission, faults = mock_run.prepare(given)
    asked = {"scenario": given.scenario, "out_dir": str(out), "run_id": uuid.uuid4().hex, "seed": given.seed, "world": given.world}
    write_json(out / "run.json", {**asked, "faults": [str(fault) for fault in faults], "mock": True, "domain": 0})
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _frame: mission.abort(f"told to end by {signal.Signals(received).name}"))
    end = mission.run()
    mock_run.write_account(out / "mock.json", mission, faults)
    monitor = Monitor(models_of(dict.fromkeys(event.skillset for event in mission.events))) if given.monitor else None
    LiveEvents(out, _say, monitor).show_new()
    code = EXIT_CODES[end.outcome]
    conformance = None if monitor is None else monitor.verdict.as_dict()
    summary = make_report(RunFacts(given.scenario, given.seed, out, given.fail, (), code, mock=True, conformance=conformance))
    sys.stdout.write("\n".join(verdict_lines(summary, (), out)) + "\n")
    return code


def _say(line: str) -> None:
    sys.stderr.write(f"{line}\n")


def main(words: Sequence[str] | None = None) -> int:
    """Run; return the exit code."""
    try:
        return run(parse(sys.argv[1:] if words is None else words))
    except (AnalysisError, FaultError, RobotError, ScenarioError, InputError, OSError) as error:
        sys.stderr.write(f"alula run: {error}\n")
        return CANNOT_START


if __name__ == "__main__":
    sys.exit(main())
