"""``./alula replay`` of an installation: the depths below the skills, on top of the library's replay (``alula.commands.replay``).

``functional``: the bag of the functional layer answers the real hooks. ``sensors``: the perception perceives again first, in the ROS 1
world. A bag of measurements without a mission's record is perceived alone.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from sensor_replay.nodes import is_setting

from alula.commands import replay
from alula.commands.replay import Arguments, Below, Depth, parse
from alula.common.record import FILE
from alula.records.replay.deciding import BAG, bag_of
from alula.records.replay.recorded import Recorded, ReplayError
from skillset_ros2.replay import from_bag

SENSORS = "sensors"


def functional(given: Arguments, recorded: Recorded, folder: Path) -> Below:  # noqa: ARG001 - as every depth
    """Have the functional layer's bag answer."""
    return Below(from_bag(bag_of(recorded, given.run)), given.fail, given.settings)


def sensors(given: Arguments, recorded: Recorded, folder: Path) -> Below:
    """Perceive again; what fails and is set there is the perception's business."""
    own = [text for text in given.settings if is_setting(text)]
    bag = perceive(bag_of(recorded, given.run), folder, given.fail, own, given.names)
    return Below(from_bag(bag), [], [text for text in given.settings if not is_setting(text)])


DEPTHS: Mapping[str, Depth] = {"functional": functional, SENSORS: sensors}


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
    return replay.SAME


def perceive(bag: Path, folder: Path, faults: Sequence[str], settings: Sequence[str], names: Sequence[str]) -> Path:
    """Return a bag like this one, with what the perception says of its measurements now; it lies in ``folder``.

    ``names``: what topics of the bag are called here, as ``/theirs:=/ours``.

    Raises:
        ReplayError: the bag holds no measurements, or a failure or a setting does not exist.
    """
    again = folder / BAG
    options = [*each("--fail", faults), *each("--set", settings), *each("--map", names)]
    words = [str(Path(os.environ["ALULA_ROOT"]) / "setup" / "in_ros1"), "python3", "-m", "sensor_replay", str(bag), str(again), *options]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReplayError((done.stderr.strip().splitlines() or [f"perceiving ended with {done.returncode}"])[-1])
    return again


def each(option: str, values: Sequence[str]) -> list[str]:
    """Return an option of a command line for each value."""
    return [word for value in values for word in (option, value)]


def main(words: Sequence[str] | None = None) -> int:
    """Replay; return the exit code."""
    words = sys.argv[1:] if words is None else words
    given = parse(words, DEPTHS)
    if given.depth == SENSORS and given.run.suffix == ".bag" and not given.run.with_name(FILE).exists():
        try:
            with tempfile.TemporaryDirectory() as folder:
                return perception_alone(given, Path(folder))
        except (ReplayError, OSError) as error:
            sys.stderr.write(f"alula replay: {error}\n")
            return replay.CANNOT_REPLAY
    return replay.main(words, DEPTHS)


if __name__ == "__main__":
    sys.exit(main())
