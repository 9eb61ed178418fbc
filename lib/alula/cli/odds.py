"""``alula odds MISSION.xml``: how likely it is accomplished, degraded, given up in order, or neither.

Ends with 0, and with 2 when a file can't be read or is wrong, or there is no Storm.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from alula.check.robot import models_of, part_of
from alula.cli.saying import warner
from alula.cli.table import parse
from alula.common.files import write_text
from alula.common.robots import FAULTS, RobotError, RobotFolder, find_robot
from alula.common.scenarios import ScenarioError, load_scenario, scenario_names
from alula.missions.plan import InputError, Inputs
from alula.missions.scenario import inputs_of
from alula.mock import load_behaviour
from alula.model.model import Skillset
from alula.odds.errors import OddsError
from alula.odds.figures import Figures
from alula.odds.graph import explore
from alula.odds.mission import Brought, MissionSteps
from alula.odds.odds import changed, odds_of
from alula.odds.reading import load_figures
from alula.odds.telling import as_dict, as_svg, as_text
from alula.prove.mission.managers import Failures
from alula.prove.mission.oracle import UndecidedError
from alula.prove.mission.system import System
from alula.records.causes.effects import FaultEffects
from alula.records.causes.fault_file import load_effects
from alula.records.errors import AnalysisError
from alula.runtime.core.errors import SkillRuntimeError
from alula.trees.errors import TreeError

COMMAND = "alula odds"
WRONG = 2
COUNTED = 100  # attempts and rounds, exactly: each has its share of the odds


def main(words: Sequence[str] | None = None) -> int:
    """Tell the odds; return the exit code."""
    given = parse("odds", words)
    try:
        return run(given)
    except (
        OddsError,
        AnalysisError,
        RobotError,
        ScenarioError,
        InputError,
        UndecidedError,
        SkillRuntimeError,
        TreeError,
        OSError,
    ) as error:
        sys.stderr.write(f"{COMMAND}: {error}\n")
        return WRONG


def run(given: argparse.Namespace) -> int:
    """Do what is asked for; raises what ``main`` tells."""
    if given.most < 1:
        raise OddsError(f"--most {given.most}: is a number of situations, from 1 on")
    steps, figures = steps_of(given.file, given.world)
    graph = explore(steps, figures, most=given.most, unlikely=given.unlikely, tell=_tell)
    changes = {text: changed(figures, text, graph) for text in given.changes}
    found = odds_of(graph, figures)
    others = {text: odds_of(graph, other, costs=False) for text, other in changes.items()}
    title = f"{given.file.name}: odds"
    if given.svg is not None:
        write_text(given.svg, as_svg(title, found))
    sys.stdout.write(json.dumps(as_dict(found, others)) + "\n" if given.json else as_text(title, found, others))
    return 0


def steps_of(path: Path, world: str = "", others: Figures | None = None) -> tuple[MissionSteps, Figures]:
    """Return what can happen to a mission's file of this robot, and the figures that it hangs on: the robot's, or others.

    Raises what ``main`` tells.
    """
    robot = find_robot()
    models = models_of(robot, warner(COMMAND))
    figures, effects = _of_faults(robot, models)
    failures = Failures(refusals=False, hooks=False, aborts=False)
    part = part_of(robot, warner(COMMAND))
    system = System.read(path, models, part, failures, few=COUNTED, known=_inputs(path, world))
    known = figures if others is None else others
    return MissionSteps(system, effects, _brought(robot, models), _departure(robot, models), known), known


def _inputs(path: Path, world: str) -> Inputs | None:
    """Return the inputs of the scenario that flies a mission's file; None where there is no such scenario."""
    found = [load_scenario(name) for name in scenario_names()]
    scenario = next((one for one in found if one.mission.endswith(".xml") and (find_robot().root / one.mission).samefile(path)), None)
    return None if scenario is None else inputs_of(scenario, world)


def _of_faults(robot: RobotFolder, models: Sequence[Skillset]) -> tuple[Figures, Mapping[str, FaultEffects]]:
    file = robot.file(FAULTS)
    return (Figures(), {}) if file is None else (load_figures(file, models), load_effects(file, models).known)


def _brought(robot: RobotFolder, models: Sequence[Skillset]) -> Brought:
    """Return what the mocks of skills bring about: the functional layer does the same."""
    rules = load_behaviour(robot.behaviour_files, models).rules
    found: dict[str, set[tuple[str, str]]] = {}
    for (skillset, skill), several in rules.items():
        for change in (change for rule in several for change in rule.changes or ()):
            pairs = {(f"{of}.{resource}", state) for (of, resource), state in change.states.items()}
            found.setdefault(f"{skillset}.{skill}", set()).update(pairs)
    return {skill: sorted(pairs) for skill, pairs in found.items()}


def _departure(robot: RobotFolder, models: Sequence[Skillset]) -> tuple[str, str] | None:
    if robot.departure is None:
        return None
    name, state = robot.departure
    of = next((one.name for one in models if name in one.resource_index), None)
    return None if of is None else (f"{of}.{name}", state)


def _tell(found: int, looked: int) -> None:
    sys.stderr.write(f"{COMMAND}: {looked} of {found} situations looked at\n")


if __name__ == "__main__":
    sys.exit(main())
