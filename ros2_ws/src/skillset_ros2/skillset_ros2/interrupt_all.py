"""Interrupt whatever runs of skillsets: ``python -m skillset_ros2.interrupt_all SKILLSET...``, when nobody decides any more.

Ends with 0 when nothing runs any more, 1 when something does or managers were not found.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence

from alula.common.processes import NAMESPACE_VARIABLE
from alula.common.ros_arguments import split_arguments
from skillset_ros2.robot import NotThereError, Robot

END_S, LOOK_S = 30.0, 0.1
"""Wall clock; hooks may take their time to stop a function."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Interrupt; return the exit code."""
    words, _ = split_arguments(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(prog="interrupt_all", description="Interrupt whatever runs of skillsets.")
    parser.add_argument("skillsets", nargs="+", metavar="SKILLSET")
    names = parser.parse_args([word for word in words if ":=" not in word]).skillsets
    left: list[str] = []
    for name in names:  # one by one: managers that are gone must not keep the others from stopping
        try:
            with Robot.connect(name, namespace=os.environ.get(NAMESPACE_VARIABLE, "")) as robot:
                left += interrupt(robot, name)
        except NotThereError as error:
            left.append(name)
            sys.stderr.write(f"interrupt_all: {error}\n")
    return 1 if left else 0


def interrupt(robot: Robot, name: str) -> list[str]:
    """Interrupt all skills of a skillset; return those that still run."""
    client = robot.clients[name]
    end_s = time.monotonic() + END_S
    for asked in [client.interrupt_all(skill.name) for skill in client.model.skills]:
        asked.wait(max(0.0, end_s - time.monotonic()))
    while running := [skill for skill, known in client.skills.items() if known.open]:
        if time.monotonic() > end_s:
            sys.stderr.write(f"interrupt_all: {name}: {', '.join(running)} did not stop within {END_S:g} s\n")
            break
        time.sleep(LOOK_S)
    return [f"{name}.{skill}" for skill in running]


if __name__ == "__main__":
    sys.exit(main())
