"""A scenario's plan, of its mission's file with the robot's models and nodes, and its inputs."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path

from alula.common.robots import find_robot, wrong_world
from alula.common.scenarios import Scenario, load_scenario, scenario_names, scenarios_folder
from alula.common.suggestions import nearest, quoted
from alula.missions.mission_file import plan_of_file
from alula.missions.part import NO_PART
from alula.missions.plan import InputError, Inputs, MissionPlan
from alula.missions.serving import serving_plan
from alula.model.model import Skillset
from alula.trees.library import Library
from alula.trees.source import TreeSource


def plan_of(scenario: Scenario, inputs: Inputs, models: Iterable[Skillset]) -> MissionPlan:
    """Return a scenario's plan for these inputs; ``models`` are those of the robot, or as many as the scenario names.

    Raises:
        RobotError, InputError: there is no robot, it has no such skillsets or nodes, or the mission's file can't be used.
    """
    if not scenario.mission:
        return serving_plan(scenario)
    if not scenario.mission.endswith(".xml"):
        raise InputError(f"the mission {scenario.mission} is no file of a tree; name one: missions/NAME.xml")
    return plan_of_mission_file(find_robot().root / scenario.mission, scenario, inputs, models)


def check_names(scenario: Scenario, models: Iterable[Skillset]) -> None:
    """Refuse a departure of the robot, and skills of the scenario, that its models do not have; ``models`` are all of the robot's.

    Raises:
        InputError: one is not there; the message names the file, the key and what is meant.
    """
    several = list(models)
    skills = [(one.name, skill.name) for one in several for skill in one.skills]
    known = {*(skill for _, skill in skills), *(f"{skillset}.{skill}" for skillset, skill in skills)}
    for key, names in (("fallback", [scenario.fallback] if scenario.fallback else []), ("motion", scenario.motion)):
        for name in names:
            if name not in known:
                file = scenarios_folder() / f"{scenario.name}.yaml"
                raise InputError(f"{file}: `{key}`: the robot has no skill `{name}`; {_meant(name, known)}")
    robot = find_robot()
    if robot.departure is not None:
        resource, state = robot.departure
        states = {other for one in several for known in one.resources if known.name == resource for other in known.states}
        place = f"{robot.root / 'robot.yaml'}: `departure`: "
        if not states:
            resources = {known.name for one in several for known in one.resources}
            raise InputError(f"{place}the robot has no resource `{resource}`; {_meant(resource, resources)}")
        if state not in states:
            raise InputError(f"{place}the resource `{resource}` has no state `{state}`; {_meant(state, states)}")


def _meant(name: str, known: Collection[str]) -> str:
    return nearest(name, known) or f"name one of {quoted(sorted(known))}"


def flown(path: Path, scenario: Scenario) -> TreeSource:
    """Return where a file is read from as a scenario's mission."""
    library = Library()
    library.add(scenario.library)
    return TreeSource(path, library)


def by_mission() -> dict[Path, Scenario]:
    """Return the scenarios of the robot by the files of their missions (resolved paths), of several of one file the first.

    Raises:
        RobotError, ScenarioError: there is no robot, or a scenario is wrong.
    """
    root = find_robot().root
    trees = [one for one in map(load_scenario, scenario_names()) if one.mission.endswith(".xml")]
    return {(root / one.mission).resolve(): one for one in reversed(trees)}


def inputs_of(scenario: Scenario, world: str = "") -> Inputs:
    """Return a mission's inputs from a world (name or file), that of the scenario unless another is given.

    The robot's part ``inputs`` reads them from the world's file; a robot without that part has none.

    Raises:
        RobotError, InputError: there is no such world, or it can't be used.
    """
    robot = find_robot()
    read = robot.part("inputs")
    name = world or scenario.world
    if read is None or not name:
        return {}
    path = robot.world(name)
    if not path.is_file():
        raise InputError(wrong_world(robot, name))
    inputs: Inputs = read(path)
    return inputs


def plan_of_mission_file(path: Path, scenario: Scenario, inputs: Inputs, models: Iterable[Skillset]) -> MissionPlan:
    """Return the plan of a file as a scenario's mission; ``models`` as for `plan_of`.

    Raises:
        RobotError, InputError: the robot has no such skillsets or nodes, or the file can't be used.
    """
    known = {skillset.name: skillset for skillset in models}
    missing = [name for name in scenario.skillsets if name not in known]
    if missing:
        raise InputError(f"the robot has no skillset '{missing[0]}'")
    part = find_robot().part("missions") or NO_PART
    return plan_of_file(flown(path, scenario), scenario.name, [known[name] for name in scenario.skillsets], inputs, part)
