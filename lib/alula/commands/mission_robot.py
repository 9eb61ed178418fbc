"""The robot around missions that a command is about: its models, and what it adds to missions."""

from __future__ import annotations

import sys

from alula.common.robots import RobotError, RobotFolder
from alula.language.errors import has_errors
from alula.language.fleet import in_fleet
from alula.language.models import check_files, models_in
from alula.missions.part import NO_PART, MissionPart
from alula.model.model import Skillset


def models_of(robot: RobotFolder, command: str) -> tuple[Skillset, ...]:
    """Return the models of a robot as far as they can be read; what is wrong with them is told on standard error."""
    if robot.robots:
        return tuple(one for name, member in robot.robots.items() for one in in_fleet(name, models_of(member, command)))
    files = check_files(models_in(str(robot.skillsets)))
    for file in files:
        if has_errors(file.findings):
            sys.stderr.write(f"{command}: {file.path} has errors; `alula check {file.path}` shows them\n")
    return tuple(skillset for file in files for skillset in file.skillsets)


def part_of(robot: RobotFolder, command: str) -> MissionPart:
    """Return what a robot adds to missions; where that can't be imported, nothing, which is told on standard error."""
    try:
        part = robot.part("missions")
    except RobotError as error:
        sys.stderr.write(f"{command}: the robot's own nodes are not known: {error}\n")
        part = None
    return part or NO_PART
