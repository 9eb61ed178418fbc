"""``python3 -m node_core.replay BAG OUT [--fail WHAT@20] [--set NODE.NAME=VALUE]``: perceive a recorded run of the robot again.

The cores of the robot's part ``sensors`` get the measurements of a bag; OUT is the bag with what they say now in place of what they said
then. Ends with 0, or 2 with one line on standard error.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import rosbag
import yaml

from alula.common.faults import FaultError, parse_fault
from alula.common.robots import RobotError, find_robot
from node_core.replay.part import ReplayPartError, SensorPart
from node_core.replay.perceiving import Conditions, Perceiving


def settings_of(texts: Sequence[str], nodes: Sequence[str]) -> dict[str, dict[str, object]]:
    """Read ``NODE.NAME=VALUE``, a skillset before it left out, into parameters by node; raises ReplayPartError."""
    found: dict[str, dict[str, object]] = {}
    for text in texts:
        name, _, value = text.partition("=")
        *_, node, parameter = ["", "", *name.split(".")]
        if node not in nodes:
            known = f"write NODE.NAME=VALUE; nodes are {', '.join(nodes)}" if nodes else "no parameter of a node can be set here"
            raise ReplayPartError(f"--set {text}: {known}")
        found.setdefault(node, {})[parameter] = yaml.safe_load(value)
    return found


def names_of(texts: Sequence[str], part: SensorPart) -> dict[str, str]:
    """Read ``THEIRS:=OURS``; raises ReplayPartError."""
    pairs = [text.split(":=") for text in texts]
    for text, pair in zip(texts, pairs, strict=True):
        if len(pair) != 2 or not all(name.startswith("/") for name in pair):
            raise ReplayPartError(f"--map {text}: write /THEIRS:=/OURS; topics of measurements here are {', '.join(part.measured)}")
    return {pair[0]: pair[1] for pair in pairs}


def perceive(part: SensorPart, source: Path, target: Path, given: Conditions) -> None:
    """Write ``target``: the bag ``source`` with what the cores publish now about its measurements; raises ReplayPartError."""
    with rosbag.Bag(str(source)) as bag, tempfile.TemporaryDirectory() as folder:
        topics = {given.names.get(topic, topic) for topic in bag.get_type_and_topic_info().topics}
        judged = {topic for topics in part.reports.values() for topic in topics}
        if not topics & judged:
            raise ReplayPartError(
                f"{source}: holds no measurements ({', '.join(sorted(judged))}); see docs/how-to/replays.md for how to record them"
            )
        try:
            with rosbag.Bag(str(target), "w") as out:
                Perceiving(part, bag, out, given, Path(folder)).run()
        except ReplayPartError:
            target.unlink()  # nothing was perceived
            raise


def main(words: Sequence[str] | None = None) -> int:
    """Replay a bag through the cores; return the exit code."""
    parser = argparse.ArgumentParser(prog="node_core.replay", description="Perceive a recorded run again.")
    parser.add_argument("bag", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--fail", action="append", default=[], metavar="WHAT[:HOW][@SECONDS[-SECONDS]]")
    parser.add_argument("--zero", type=float, default=0.0, help="mission clock that the seconds of --fail count from")
    parser.add_argument("--map", action="append", default=[], dest="names", metavar="THEIRS:=OURS")
    parser.add_argument("--set", action="append", default=[], dest="settings", metavar="NODE.NAME=VALUE")
    parser.add_argument("--initial", type=json.loads, default={}, help="JSON: states in which resources begin, by skillset.resource")
    parser.add_argument("--world", default="", help="file of the world that the run was in")
    options = parser.parse_args(words)
    try:
        part: SensorPart = find_robot().part("sensors")
        ways = {what: tuple(hows) for what, hows in part.ways.items()}
        fail = [parse_fault(text, ways) for text in options.fail]
        parameters, names = settings_of(options.settings, part.nodes), names_of(options.names, part)
        given = Conditions(fail, options.zero, parameters, names, options.initial, Path(options.world) if options.world else None)
        perceive(part, options.bag, options.out, given)
    except (ReplayPartError, RobotError, FaultError, rosbag.ROSBagException, OSError, ValueError) as error:
        sys.stderr.write(f"{str(error) or type(error).__name__}\n".replace("\n", " ").strip() + "\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
