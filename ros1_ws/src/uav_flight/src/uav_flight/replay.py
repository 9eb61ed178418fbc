"""The drone's depth of a replay below the functional layer: the perception perceives again first, in the ROS 1 world.

A bag of measurements without a mission's record is perceived alone. This module runs in the ROS 2 world.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from alula.commands.replay import SAME, Arguments, Below, Depth
from alula.records.replay.deciding import BAG, bag_of
from alula.records.replay.recorded import Recorded, ReplayError
from skillset_ros2.replay import from_bag
from uav_flight.sensor_replay.nodes import is_setting


def sensors(given: Arguments, recorded: Recorded, folder: Path) -> Below:
    """Perceive again; what fails and is set there is the perception's business."""
    own = [text for text in given.settings if is_setting(text)]
    bag = perceive(bag_of(recorded, given.run), folder, given.fail, own, given.names)
    return Below(from_bag(bag), [], [text for text in given.settings if not is_setting(text)])


def perception_alone(given: Arguments, folder: Path) -> int:
    """Tell what the perception says of a bag that belongs to no mission: the transitions that it asks for; return the exit code."""
    from skillset_ros2.replay.bag import read_calls  # late: it needs a reader of bags

    if not given.run.is_file():
        raise ReplayError(f"{given.run}: there is no such bag")
    for call in read_calls(perceive(given.run, folder, given.fail, given.settings, given.names)):
        skillset = call.service.split("/")[1]
        text = f"{call.end_s:9.2f} s  {skillset}.{call.request.get('resource')} -> {call.request.get('to')}"
        sys.stdout.write(f"{json.dumps(vars(call)) if given.json else text}\n")
    sys.stderr.write("no record of a mission lies beside it: perceived only\n")
    return SAME


def perceive(bag: Path, folder: Path, faults: Sequence[str], settings: Sequence[str], names: Sequence[str]) -> Path:
    """Return a bag like this one, with what the perception says of its measurements now; it lies in ``folder``.

    ``names``: what topics of the bag are called here, as ``/theirs:=/ours``.

    Raises:
        ReplayError: the bag holds no measurements, or a failure or a setting does not exist.
    """
    again = folder / BAG
    options = [*each("--fail", faults), *each("--set", settings), *each("--map", names)]
    words = [str(Path(os.environ["ALULA_ROOT"]) / "setup" / "in_ros1"), "python3", "-m", "uav_flight.sensor_replay"]
    done = subprocess.run([*words, str(bag), str(again), *options], capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReplayError((done.stderr.strip().splitlines() or [f"perceiving ended with {done.returncode}"])[-1])
    return again


def each(option: str, values: Sequence[str]) -> list[str]:
    """Return an option of a command line for each value."""
    return [word for value in values for word in (option, value)]


DEPTHS: Mapping[str, Depth] = {"sensors": Depth(sensors, perception_alone)}
"""As ``robot.yaml`` names them."""
