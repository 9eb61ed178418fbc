"""``alula replay`` of an installation: the depths below the skills, on top of the library's replay (``alula.commands.replay``).

``functional``: the bag of the functional layer answers the real hooks. What lies below that is the robot's: its part ``depths``.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from alula.commands import replay
from alula.commands.replay import Arguments, Below, Depth
from alula.common.robots import RobotError, find_robot
from alula.records.replay.deciding import bag_of
from alula.records.replay.recorded import Recorded
from skillset_ros2.replay import from_bag


def functional(given: Arguments, recorded: Recorded, folder: Path) -> Below:  # noqa: ARG001 - as every depth
    """Have the functional layer's bag answer."""
    return Below(from_bag(bag_of(recorded, given.run)), given.fail, given.settings)


def depths_of_robot() -> Mapping[str, Depth]:
    """Return all depths; raises RobotError where what the robot's file names does not exist."""
    return {"functional": Depth(functional), **(find_robot().part("depths") or {})}


def main(words: Sequence[str] | None = None) -> int:
    """Replay; return the exit code."""
    try:
        depths = depths_of_robot()
    except RobotError as error:
        sys.stderr.write(f"alula replay: {error}\n")
        return replay.CANNOT_REPLAY
    return replay.main(words, depths)


if __name__ == "__main__":
    sys.exit(main())
