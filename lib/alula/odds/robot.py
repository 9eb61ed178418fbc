"""The odds of a robot's mission: what can happen to it, by its models, its mocks, its faults and their figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from alula.check.robot import Warn, models_of, part_of
from alula.common.robots import FAULTS, RobotFolder, find_robot
from alula.common.scenarios import load_scenario, scenario_names
from alula.missions.plan import Inputs
from alula.missions.scenario import inputs_of
from alula.mock import load_behaviour
from alula.model.model import Skillset
from alula.odds.figures import Figures
from alula.odds.mission import Brought, MissionSteps
from alula.odds.reading import load_figures
from alula.prove.mission.managers import Failures
from alula.prove.mission.system import System
from alula.records.causes.effects import FaultEffects
from alula.records.causes.fault_file import load_effects

COUNTED = 100  # attempts and rounds, exactly: each has its share of the odds


def ignore(_line: str) -> None:
    """Take no notice."""


def steps_of(
    path: Path, world: str = "", others: Figures | None = None, *, tell: Warn = ignore, changed: Path | None = None
) -> tuple[MissionSteps, Figures]:
    """Return what can happen to a mission's file of this robot, and the figures that it hangs on: the robot's, or others.

    ``changed`` is another file with the same mission, changed, which is looked at with this one's inputs.

    Raises:
        AlulaError: a file is missing or wrong, with its place.
    """
    robot = find_robot()
    models = models_of(robot, tell)
    figures, effects = _of_faults(robot, models)
    failures = Failures(refusals=False, hooks=False, aborts=False)
    part = part_of(robot, tell)
    system = System.read(changed or path, models, part, failures, few=COUNTED, known=_inputs(path, world))
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
