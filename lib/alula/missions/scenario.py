"""A scenario's plan, of its mission's file with the robot's models and nodes, and its inputs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from alula.common.robots import RobotFolder, find_robot, fleet_name, wrong_world
from alula.common.scenarios import Scenario
from alula.language.errors import LanguageError
from alula.language.fleet import load_models
from alula.missions.mission_file import plan_of_file
from alula.missions.part import NO_PART
from alula.missions.plan import InputError, Inputs, MissionPlan
from alula.missions.serving import serving_plan


def plan_of(scenario: Scenario, inputs: Inputs) -> MissionPlan:
    """Return a scenario's plan for these inputs; raises RobotError where there is no robot or none of its nodes, and InputError."""
    if not scenario.mission:
        return serving_plan(scenario)
    if not scenario.mission.endswith(".xml"):
        raise InputError(f"the mission {scenario.mission} is no file of a tree; name one: missions/NAME.xml")
    return plan_of_mission_file(find_robot().root / scenario.mission, scenario, inputs)


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


def plan_of_mission_file(path: Path, scenario: Scenario, inputs: Inputs) -> MissionPlan:
    """Return the plan of a file as a scenario's mission.

    Raises:
        RobotError, InputError: the robot has no such skillsets or nodes, or the file can't be used.
    """
    robot = find_robot()
    try:
        models = {skillset.name: skillset for skillset in load_models(robot).skillsets}
    except (LanguageError, OSError) as error:
        raise InputError(str(error)) from error
    missing = [name for name in scenario.skillsets if name not in models]
    if missing:
        raise InputError(f"the robot has no skillset '{missing[0]}'")
    part = robot.part("missions") or NO_PART
    plan = plan_of_file(path, scenario.name, [models[name] for name in scenario.skillsets], inputs, part)
    return replace(plan, places=places_of(robot))


def places_of(fleet: RobotFolder) -> dict[str, tuple[str, str]]:
    """Return namespace and name of each skillset of a fleet's robots, by its name in the fleet; nothing for a robot."""
    robots = [(name, one.name) for name, robot in fleet.robots.items() for one in load_models(robot).skillsets]
    return {fleet_name(robot, skillset): (f"/{robot}", skillset) for robot, skillset in robots}
