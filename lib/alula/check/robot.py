"""What a mission's file is read with: the models of the robot around it, and what the robot adds to missions."""

from __future__ import annotations

from collections.abc import Callable

from alula.common.robots import RobotError, RobotFolder
from alula.language.errors import has_errors
from alula.language.fleet import in_fleet
from alula.language.models import check_files, models_in
from alula.missions.part import NO_PART, MissionPart
from alula.model.model import Skillset

Warn = Callable[[str], object]
"""Takes a line about what is wrong, and is left out."""


def models_of(robot: RobotFolder, warn: Warn) -> tuple[Skillset, ...]:
    """Return the models of a robot as far as they can be read; ``warn`` receives which have errors."""
    if robot.robots:
        return tuple(one for name, member in robot.robots.items() for one in in_fleet(name, models_of(member, warn)))
    files = check_files(models_in(str(robot.skillsets)))
    for file in files:
        if has_errors(file.findings):
            warn(f"{file.path} has errors; `alula check {file.path}` shows them")
    return tuple(skillset for file in files for skillset in file.skillsets)


def part_of(robot: RobotFolder, warn: Warn) -> MissionPart:
    """Return what a robot adds to missions; nothing where that can't be imported: ``warn`` receives the reason."""
    try:
        part = robot.part("missions")
    except RobotError as error:
        warn(f"the robot's own nodes are not known: {error}")
        part = None
    return part or NO_PART
