"""The models of a robot's folder; those of a fleet are its robots', each under a name with its robot's as prefix."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from alula.common.robots import RobotFolder, fleet_name
from alula.language.errors import LanguageError
from alula.language.load import load_robot
from alula.language.models import about
from alula.language.robot import Bindings, Robot
from alula.model.model import Skillset
from alula.model.ros_types import RosType


def load_models(folder: RobotFolder) -> Robot:
    """Return the models of a robot, or of a fleet; raises LanguageError."""
    return (
        load_robot(folder.skillsets) if not folder.robots else together(folder, {n: load_models(one) for n, one in folder.robots.items()})
    )


def together(fleet: RobotFolder, robots: Mapping[str, Robot]) -> Robot:
    """Return the models of a fleet's robots as those of one.

    Raises:
        LanguageError: two robots have a type of one name that is not the same in ROS.
    """
    types: dict[str, RosType] = {}
    for name, robot in robots.items():
        for kind, ros in robot.types.items():
            if types.setdefault(kind, ros) != ros:
                message = f"type `{kind}` of {name} is {ros.interface}, and that of another robot is {types[kind].interface}"
                raise LanguageError([about(fleet.robots[name].skillsets / "types.yaml", "ALU401", message)])
    bound = {(fleet_name(name, key[0]), key[1]): source for name, robot in robots.items() for key, source in robot.bindings.data.items()}
    files = {fleet_name(name, skillset): file for name, robot in robots.items() for skillset, file in robot.files.items()}
    skillsets = tuple(one for name, robot in robots.items() for one in in_fleet(name, robot.skillsets))
    return Robot(fleet.name, skillsets, types, Bindings(bound), files)


def places_of(fleet: RobotFolder) -> dict[str, tuple[str, str]]:
    """Return namespace and own name of each skillset of a fleet, as ("/rover", "base"), by its name in the fleet; nothing for a robot.

    Raises:
        LanguageError: the models of one of its robots have errors.
    """
    skillsets = [(robot, one.name) for robot, folder in fleet.robots.items() for one in load_models(folder).skillsets]
    return {fleet_name(robot, skillset): (f"/{robot}", skillset) for robot, skillset in skillsets}


def in_fleet(robot: str, skillsets: tuple[Skillset, ...]) -> tuple[Skillset, ...]:
    """Return a robot's skillsets under their names in a fleet."""
    return tuple(replace(one, name=fleet_name(robot, one.name)) for one in skillsets)


def of_robot(robot: str, skillsets: Iterable[Skillset]) -> tuple[Skillset, ...]:
    """Return the skillsets of a fleet that are a robot's, under their own names."""
    before = fleet_name(robot, "")
    return tuple(replace(one, name=one.name.removeprefix(before)) for one in skillsets if one.name.startswith(before))
