"""Print what set-up and the environments have to know of a robot, as assignments of a shell: python describe_robot.py.

Places in the robot's folder stay relative to ``$ALULA_ROBOT``: a copy of the folder may share what was built.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from alula.common.robots import RobotError, RobotFolder, RosPart, load_robot_folder


def place(path: Path, root: Path) -> str:
    """Return a path as a word of the shell."""
    return f'"$ALULA_ROBOT"/{shlex.quote(str(path.relative_to(root)))}' if path.is_relative_to(root) else shlex.quote(str(path))


def world_lines(world: str, part: RosPart, root: Path) -> Iterator[str]:
    """Yield what a robot has in a world."""
    yield f"robot_packages{world}={':'.join(place(path, root) for path in part.packages)}"
    yield f"robot_python{world}={place(part.python, root) if part.python else ''}"
    yield f"robot_underlays{world}=({' '.join(place(path, root) for path in part.underlays)})"
    yield f"robot_debian{world}={shlex.quote(' '.join(part.debian))}"


def lines(robot: RobotFolder) -> Iterator[str]:
    """Yield the assignments."""
    yield f"robot_name={robot.name}"
    yield f"robot_skillsets={place(robot.skillsets, robot.root)}"
    yield f"robot_fleet=({' '.join(place(one.skillsets, robot.root) for one in robot.robots.values())})"
    yield from world_lines("1", robot.ros1, robot.root)
    # A fleet's missions take data in the messages of its robots.
    below = [path for one in robot.robots.values() for path in one.ros2.packages]
    yield from world_lines("2", replace(robot.ros2, packages=(*robot.ros2.packages, *below)), robot.root)


if __name__ == "__main__":
    try:
        sys.stdout.write("".join(f"{line}\n" for line in lines(load_robot_folder(Path(os.environ["ALULA_ROBOT"])))))
    except RobotError as error:
        sys.exit(f"error: {error}")
