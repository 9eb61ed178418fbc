"""``alula replay`` of an installation: the depths below the skills, on top of the library's replay (``alula.cli.replay``).

``functional``: the bag of the functional layer answers the real hooks. ``sensors``, for a robot with the part of that name: the cores of
its nodes perceive the measurements again first, in the ROS 1 world; a bag of measurements without a mission's record is perceived alone.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from alula.cli import replay
from alula.cli.replay import Arguments, Below, Depth
from alula.common.robots import RobotError, find_robot
from alula.common.scenarios import ScenarioError, load_scenario
from alula.language.load import load_robot
from alula.records.replay.deciding import BAG, bag_of
from alula.records.replay.recorded import Recorded, ReplayError
from alula.runtime.live.spec import FILE as RUN
from alula.runtime.live.spec import RunSpec
from skillset_ros2.replay import from_bag
from skillset_ros2.replay.bag import read_calls

SENSORS = "sensors"


def functional(given: Arguments, recorded: Recorded, folder: Path) -> Below:  # noqa: ARG001 - as every depth
    """Have the functional layer's bag answer."""
    return Below(from_bag(bag_of(recorded, given.run)), given.fail, given.settings)


def sensors(given: Arguments, recorded: Recorded, folder: Path) -> Below:
    """Perceive again; what fails, and parameters of nodes, are the perception's business."""
    bag = perceive(bag_of(recorded, given.run), folder, given, "--zero", str(recorded.zero_s), "--world", world_of(recorded))
    return Below(from_bag(bag), [], [text for text in given.settings if not of_a_node(text)])


def perception_alone(given: Arguments, folder: Path) -> int:
    """Tell what the perception says of a bag that belongs to no mission: the transitions that it asks for; return the exit code."""
    if not given.run.is_file():
        raise ReplayError(f"{given.run}: there is no such bag")
    for call in read_calls(perceive(given.run, folder, given)):
        skillset = call.service.split("/")[1]
        text = f"{call.end_s:9.2f} s  {skillset}.{call.request.get('resource')} -> {call.request.get('to')}"
        sys.stdout.write(f"{json.dumps(vars(call)) if given.json else text}\n")
    sys.stderr.write("no record of a mission lies beside it: perceived only\n")
    return replay.SAME


def world_of(recorded: Recorded) -> str:
    """Return the file of the world that a run was in, as it was asked for; of a record alone, the scenario's; empty: none."""
    asked = recorded.path.with_name(RUN)
    try:
        if asked.is_file():
            return RunSpec.load(asked).world
        world = load_scenario(recorded.scenario).world
    except (OSError, ValueError, TypeError, ScenarioError) as error:
        raise ReplayError(f"{asked}: does not tell the world of the run: {error}") from error
    return world and str(find_robot().world(world))


def perceive(bag: Path, folder: Path, given: Arguments, *options: str) -> Path:
    """Return a bag like this one, with what the nodes say of its measurements now; it lies in ``folder``.

    Raises:
        ReplayError: the bag holds no measurements, or a failure or a setting does not exist.
    """
    again, skillsets = folder / BAG, load_robot(find_robot().skillsets).skillsets
    initial = {f"{skillset.name}.{resource.name}": resource.initial for skillset in skillsets for resource in skillset.resources}
    own = [*each("--fail", given.fail), *each("--set", filter(of_a_node, given.settings)), *each("--map", given.names)]
    command = [str(Path(os.environ["ALULA_ROOT"]) / "setup" / "in_ros1"), "python3", "-m", "node_core.replay", str(bag), str(again)]
    words = [*command, "--initial", json.dumps(initial), *own, *options]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReplayError((done.stderr.strip().splitlines() or [f"perceiving ended with {done.returncode}"])[-1])
    return again


def of_a_node(text: str) -> bool:
    """Return whether ``NODE.NAME=VALUE`` is about a node, and not a parameter of the mission."""
    return "." in text.partition("=")[0]


def each(option: str, values: Sequence[str] | Iterator[str]) -> list[str]:
    """Return an option of a command line for each value."""
    return [word for value in values for word in (option, value)]


def depths_of_robot() -> Mapping[str, Depth]:
    """Return all depths; raises RobotError where there is no robot."""
    depths = {"functional": Depth(functional)}
    return depths | {SENSORS: Depth(sensors, perception_alone)} if SENSORS in find_robot().parts else depths


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
