"""A flight over mocks as a process, without ROS: ``python -m uav_missions.mock_flight --out DIR --route FILE --behaviour FILE``.

It leaves what any mission leaves, and ``mock.json``: how long it took, and what failed when. Ends with 0 (accomplished, also when
degraded), 1 (given up or aborted), 2 (could not start, or was asked for something that can't be; then nothing is written).
"""

from __future__ import annotations

import argparse
import importlib
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.common.faults import FaultError, FaultRequest, changes_of, parse_fault, spans_of
from alula.common.files import write_json
from alula.common.scenarios import ScenarioError, load_scenario
from alula.missions.director import EXIT_CODES, End, Outcome
from alula.missions.mocked import MockedMission
from alula.model.model import Skillset
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.mock import load_behaviour
from uav_missions.plan import ROBOT, plan_of, write_route
from uav_missions.route import Route, RouteError, load_route

CANNOT_START = EXIT_CODES[Outcome.NOT_STARTED]
MOCK = "mock"
"""The mode of what failed in mocks without a word for the way of failing."""


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the arguments."""
    parser = argparse.ArgumentParser(prog="mock_flight", description="Fly a mission over mocks, in virtual time.")
    parser.add_argument("--scenario", default="mapping", help="which one of the folder scenarios")
    parser.add_argument("--out", type=Path, required=True, help="the run's folder, new or empty")
    parser.add_argument("--route", type=Path, required=True, help="YAML or JSON file with the key 'route': a list of [x, y, z]")
    parser.add_argument("--behaviour", type=Path, action="append", default=[], help="behaviour file; later ones come first")
    parser.add_argument("--fail", action="append", default=[], metavar="WHAT[:HOW][@SECONDS[-SECONDS]]", help="a fault of the behaviour")
    parser.add_argument("--seed", type=int, default=0, help="seed of the behaviour's chance")
    return parser.parse_args(arguments)


def drone(names: Sequence[str] = ROBOT) -> list[Skillset]:
    """Return the models that the drone's managers execute."""
    return [importlib.import_module(f"{name}_managers.model").SKILLSET for name in names]


def prepare(options: argparse.Namespace) -> tuple[MockedMission, Route, list[FaultRequest]]:
    """Read what the flight needs; return the mission, its route, and what is to fail.

    Raises:
        FaultError, ScenarioError, SkillRuntimeError, RouteError: a fault or one of the files, or a fault that the behaviour has not.
    """
    scenario, route = load_scenario(options.scenario), load_route(options.route)
    behaviour = load_behaviour(options.behaviour, drone()).of(frozenset(scenario.skillsets))
    faults = [parse_fault(text) for text in options.fail]
    for request in faults:
        behaviour.fault(request)
    plan = plan_of(scenario, route)
    options.out.mkdir(parents=True, exist_ok=True)
    mission = MockedMission(drone(scenario.skillsets), behaviour, plan, faults=faults, seed=options.seed, out=options.out)
    return mission, route, faults


def write_account(path: Path, mission: MockedMission, faults: Sequence[FaultRequest]) -> None:
    """Write ``mock.json``; times are mission clock, but for ``wall_s``."""
    simulated_s, lift_off_s = mission.world.now_s, mission.departure_s
    spans = spans_of(faults, begun_s=0.0, lift_off_s=lift_off_s, ended_s=simulated_s, first_s=mission.robot.faults)
    content = {
        "simulated_s": simulated_s,
        "wall_s": mission.wall_s,
        "factor": simulated_s / mission.wall_s,
        "lift_off_s": lift_off_s,
        "faults": [vars(change) for change in changes_of(spans, simulated_s, MOCK)],
        "notes": mission.notes,
    }
    write_json(path, content)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly; return the exit code."""
    options = parse(sys.argv[1:] if arguments is None else arguments)
    try:
        mission, route, faults = prepare(options)
        write_route(options.out, route)
    except (FaultError, ScenarioError, SkillRuntimeError, RouteError, OSError) as error:
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
