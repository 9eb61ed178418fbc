"""A run over mocks as a process, in virtual time and without ROS: ``python -m alula.campaign.mock_run SCENARIO --out DIR``.

It leaves what any mission leaves, and ``mock.json``: how long it took, and what failed when. Ends with 0 (accomplished, also when
degraded), 1 (given up or aborted), 2 (could not start, or was asked for something that can't be; then nothing is written).
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.campaign.mock_flights import load_flights
from alula.common.faults import MOCKED, FaultError, FaultRequest, changes_of, parse_fault, spans_of
from alula.common.files import write_json
from alula.common.robots import RobotError
from alula.missions.director import EXIT_CODES, End, Outcome
from alula.missions.mocked import MockedMission
from alula.missions.plan import InputError
from alula.records.errors import AnalysisError

CANNOT_START = EXIT_CODES[Outcome.NOT_STARTED]


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the arguments."""
    parser = argparse.ArgumentParser(prog="mock_run", description="Run a mission over mocks, in virtual time.")
    parser.add_argument("scenario", help="one of the robot's")
    parser.add_argument("--out", type=Path, required=True, help="the run's folder, new or empty")
    parser.add_argument("--world", default="", help="world that the mission's inputs come from, by name or file")
    parser.add_argument("--behaviour", type=Path, action="append", default=[], help="on top of the robot's own; later ones come first")
    parser.add_argument("--fail", action="append", default=[], metavar="WHAT[:HOW][@SECONDS[-SECONDS]]", help="a fault of the behaviour")
    parser.add_argument("--seed", type=int, default=0, help="seed of the behaviour's chance")
    return parser.parse_args(arguments)


def prepare(options: argparse.Namespace) -> tuple[MockedMission, list[FaultRequest]]:
    """Read what the run needs; return the mission, and what is to fail.

    Raises:
        AnalysisError, FaultError, RobotError, InputError: a fault or one of the files, or a fault that the behaviour has not.
    """
    flights = load_flights(options.scenario, options.behaviour, world=options.world)
    faults = [parse_fault(text) for text in options.fail]
    flights.check(faults)
    plan = flights.plan()
    options.out.mkdir(parents=True, exist_ok=True)
    return MockedMission(flights.skillsets, flights.behaviour, plan, faults=faults, seed=options.seed, out=options.out), faults


def write_account(path: Path, mission: MockedMission, faults: Sequence[FaultRequest]) -> None:
    """Write ``mock.json``; times are mission clock, but for ``wall_s``."""
    simulated_s, lift_off_s = mission.world.now_s, mission.departure_s
    spans = spans_of(faults, begun_s=0.0, lift_off_s=lift_off_s, ended_s=simulated_s, first_s=mission.robot.faults)
    content = {
        "simulated_s": simulated_s,
        "wall_s": mission.wall_s,
        "factor": simulated_s / mission.wall_s,
        "lift_off_s": lift_off_s,
        "faults": [vars(change) for change in changes_of(spans, simulated_s, MOCKED)],
        "notes": mission.notes,
    }
    write_json(path, content)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run; return the exit code."""
    options = parse(sys.argv[1:] if arguments is None else arguments)
    try:
        mission, faults = prepare(options)
    except (AnalysisError, FaultError, RobotError, InputError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return CANNOT_START
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda received, _frame: mission.abort(f"told to end by {signal.Signals(received).name}"))
    end: End = mission.run()
    try:
        write_account(options.out / "mock.json", mission, faults)
    except OSError as error:
        sys.stderr.write(f"mock.json could not be written: {error.strerror}\n")
    return EXIT_CODES[end.outcome]


if __name__ == "__main__":
    sys.exit(main())
