"""The odds of a robot's mission: what can happen to it, by its models, its mocks, its faults and their figures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from alula.check.robot import Warn, models_of, part_of
from alula.common.robots import FAULTS, RobotFolder, find_robot
from alula.missions.mission_file import MissionFile
from alula.missions.scenario import by_mission, flown, inputs_of
from alula.mock import Behaviour
from alula.mock.behaviour import Place
from alula.model.model import Skillset
from alula.odds.figures import Figures
from alula.odds.graph import MOST_SITUATIONS, Graph, OnProgress, explore
from alula.odds.mission import Brought, MissionSteps
from alula.odds.reading import load_figures
from alula.prove.mission.findings import taken_as
from alula.prove.mission.managers import Failures
from alula.prove.mission.system import System, look_at
from alula.records.causes.effects import FaultEffects
from alula.records.causes.fault_file import effects_of
from alula.records.mocks import behaviour_of
from alula.records.models import members

COUNTED = 100  # attempts, rounds and what scripts count, exactly: each has its share of the odds


def ignore(_line: str) -> None:
    """Ignore a warning."""


def mission_of(
    path: Path,
    world: str = "",
    others: Figures | None = None,
    *,
    warn: Warn = ignore,
    changed: Path | None = None,
    models: Sequence[Skillset] | None = None,
) -> tuple[Callable[[str], System], Callable[[System], MissionSteps], Figures]:
    """Return a reader of a mission's file for this robot, as ``look_at`` takes it, the events that can occur, and the figures used.

    Args:
        path: of the mission.
        world: of its scenario, where that has several.
        others: figures in the place of the robot's.
        warn: is told what can't be read.
        changed: another file with the same mission, changed, which is looked at with this one's inputs.
        models: in the place of the robot's.

    Raises:
        AlulaError: a file is missing or wrong, with its place.
    """
    robot = find_robot()
    models = models_of(robot, warn) if models is None else models
    figures, effects = _of_faults(robot, models)
    failures = Failures(refusals=False, hooks=False, aborts=False)
    part, departure = part_of(robot, warn), _departure(robot, models)
    brought, at_first = brought_about(robot, models)
    scenario = by_mission().get(path.resolve())
    inputs = None if scenario is None else inputs_of(scenario, world)
    file = changed or path
    source = file if scenario is None else flown(file, scenario)
    mission = MissionFile.read(source, models, part)
    known = figures if others is None else others

    def read(why_any_order: str) -> System:
        return System.of(mission, failures, few=COUNTED, known=inputs, why_any_order=why_any_order, counted=COUNTED)

    return read, lambda system: MissionSteps(system, effects, brought, departure, known, at_first), known


def graph_of(
    path: Path,
    world: str = "",
    others: Figures | None = None,
    *,
    most: int = MOST_SITUATIONS,
    unlikely: float = 0.0,
    on_progress: OnProgress | None = None,
    warn: Warn = ignore,
    changed: Path | None = None,
) -> tuple[Graph, Figures]:
    """Return the situations that a mission's file of this robot can come into, and the figures: the robot's, or others.

    Args:
        path: of the mission.
        world: of its scenario, where that has several.
        others: figures in the place of the robot's.
        most: of the situations that are looked at, as of ``explore``.
        unlikely: as of ``explore``.
        on_progress: as of ``explore``.
        warn: is told what can't be read, and which nodes may do anything, so that the odds are bounds over all of that.
        changed: another file with the same mission, changed, which is looked at with this one's inputs.

    Raises:
        AlulaError: a file is missing or wrong, with its place.
    """
    read, steps_of, known = mission_of(path, world, others, warn=warn, changed=changed)

    def look(system: System) -> tuple[Graph, System]:
        return explore(steps_of(system), known, most=most, unlikely=unlikely, on_progress=on_progress), system

    graph, system = look_at(read, look)
    for finding in taken_as(system, exactly=False):
        warn(f"{finding.span}: {finding.message}")
    return graph, known


def _of_faults(robot: RobotFolder, models: Sequence[Skillset]) -> tuple[Figures, Mapping[str, FaultEffects]]:
    return figures_of(robot, models), effects_of(robot, models).known


def figures_of(robot: RobotFolder, models: Sequence[Skillset]) -> Figures:
    """Return the figures of a robot with these models; those of a fleet are its robots', under the fleet's names.

    Raises OddsError where a file can't be read or is wrong.
    """
    if robot.robots:
        each = [figures_of(one.robot, one.skillsets).named(one.name) for one in members(robot, models)]
        faults = {what: figures for one in each for what, figures in one.faults.items()}
        return Figures(faults, {skill: figures for one in each for skill, figures in one.skills.items()})
    file = robot.file(FAULTS)
    return Figures() if file is None else load_figures(file, models)


def brought_about(robot: RobotFolder, models: Sequence[Skillset]) -> tuple[Brought, frozenset[tuple[str, str]]]:
    """Return what the mocks of skills bring about, as the functional layer does, and what comes by itself after power-up.

    Raises AlulaError where a file of mocks can't be read.
    """
    several = list(_with_those_beside(behaviour_of(robot, skillsets=models)))
    at_first = frozenset(_named(place, state) for mocks in several for one in mocks.timeline for place, state in one.states.items())
    return {skill: pairs for mocks in several for skill, pairs in _brought(mocks).items()}, at_first


def _with_those_beside(mocks: Behaviour) -> Iterator[Behaviour]:
    yield mocks
    for one in mocks.beside:
        yield from _with_those_beside(one)


def _brought(mocks: Behaviour) -> Brought:
    found: dict[str, set[tuple[str, str]]] = {}
    for (skillset, skill), several in mocks.rules.items():
        for change in (change for rule in several for change in rule.changes or ()):
            found.setdefault(f"{skillset}.{skill}", set()).update(_named(place, state) for place, state in change.states.items())
    return {skill: sorted(pairs) for skill, pairs in found.items()}


def _named(place: Place, state: str) -> tuple[str, str]:
    skillset, resource = place
    return f"{skillset}.{resource}", state


def _departure(robot: RobotFolder, models: Sequence[Skillset]) -> tuple[str, str] | None:
    if robot.departure is None:
        return None
    name, state = robot.departure
    of = next((one.name for one in models if name in one.resource_index), None)
    return None if of is None else (f"{of}.{name}", state)
