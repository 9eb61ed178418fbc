"""All files of a robot: two packages a skillset, one for its clients, and the bridge's configuration."""

from __future__ import annotations

from alula.generate.bridge import bridge_configuration
from alula.generate.client_package import client_package
from alula.generate.interfaces import interface_package
from alula.generate.manager_package import manager_package
from alula.language.robot import Robot

Files = dict[str, str]
"""Text by path, the path relative to the output folder."""


def robot_files(robot: Robot) -> Files:
    """Return everything that is generated for a robot; the same models give the same text."""
    files: Files = {}
    for skillset in robot.skillsets:
        files |= interface_package(robot, skillset)
        files |= manager_package(robot, skillset)
    files |= client_package(robot)
    files[f"{robot.name}_bridge.yaml"] = bridge_configuration(robot)
    return files
