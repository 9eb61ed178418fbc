"""The module ``mock.py`` of a managers' package: the skillset with scripted behaviour, as a ROS 2 process and in this process."""

from __future__ import annotations

from alula.generate.text import fill, header
from alula.language.robot import Robot
from alula.model.model import Skillset

MOCK = '''\
"""The skillset ``$skillset``, mocked: ``python -m ${skillset}_managers.mock [--behaviour FILE] [--seed N] [--ros-args ...]``.

$header.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from alula.mock import mock_world

from ${skillset}_managers.model import DATA_TOPICS, SKILLSET

if TYPE_CHECKING:
    from alula import Behaviour, LocalWorld
    from alula.mock import Play


def in_process(behaviour: Behaviour | None = None, *, seed: int = 0) -> tuple[LocalWorld, Play]:
    """Mock the skillset in this process, in virtual time; ``world.client("$skillset")`` calls it."""
    return mock_world([SKILLSET], behaviour, seed=seed)


def main() -> None:
    """Mock the skillset as a ROS 2 node until SIGINT or SIGTERM."""
    from skillset_ros2.mock import main_of

    sys.exit(main_of(SKILLSET, DATA_TOPICS))


if __name__ == "__main__":
    main()
'''


def mock_module(robot: Robot, skillset: Skillset) -> str:
    """Return the text of ``mock.py``: the program that serves the skillset by mocks."""
    return fill(MOCK, skillset=skillset.name, header=header(robot, skillset))
