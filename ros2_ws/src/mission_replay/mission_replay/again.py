"""Perceiving again: recorded measurements through the perception's real nodes, as a process of the ROS 1 world."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

from mission_replay.recorded import Recorded, ReplayError

BAG = "functional.bag"
NODES = ("zed_depth", "lidar_obstacles", "lidar_mapping")
"""The nodes that perceive again; their parameters can be set."""


def bag_of(recorded: Recorded, given: Path) -> Path:
    """Return the bag that was given, or the one beside the record; raises ReplayError."""
    path = given if given.suffix == ".bag" else recorded.path.parent / BAG
    if not path.is_file():
        raise ReplayError(f"{path}: there is no such bag; a flight over mocks has none, replay it with --from skills")
    return path


def is_perception(setting: str) -> bool:
    """Tell whether ``NODE.NAME=VALUE`` is about the perception, and not a parameter of the mission."""
    return setting.removeprefix("perception.").removeprefix("mapping.").partition(".")[0] in NODES


def perceive(bag: Path, folder: Path, faults: Sequence[str], settings: Sequence[str], names: Sequence[str]) -> Path:
    """Return a bag like this one, with what the perception says of its measurements now; it lies in ``folder``.

    ``names``: what topics of the bag are called here, as ``/theirs:=/ours``.

    Raises:
        ReplayError: the bag holds no measurements, or a failure or a setting does not exist.
    """
    again = folder / BAG
    words = [str(Path(os.environ["ALULA_ROOT"]) / "setup" / "in_ros1"), "python3", "-m", "sensor_replay", str(bag), str(again)]
    words += [word for fault in faults for word in ("--fail", fault)] + [word for text in settings for word in ("--set", text)]
    words += [word for text in names for word in ("--map", text)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReplayError((done.stderr.strip().splitlines() or [f"perceiving ended with {done.returncode}"])[-1])
    return again
