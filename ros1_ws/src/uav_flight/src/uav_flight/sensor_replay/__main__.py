"""``python3 -m uav_flight.sensor_replay BAG OUT [--fail zed@20] [--set zed_depth.NAME=VALUE]``: perceive a recorded flight again.

The cores of zed_depth, lidar_obstacles and lidar_mapping get the measurements of a bag (``./alula fly --record sensors``); OUT is the
bag with what they say now in place of what they said then. Ends with 0, or 2 with one line on standard error.
"""

from __future__ import annotations

import argparse
import functools
import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import rosbag
import rospy
import yaml

from alula.common.faults import FaultError
from lidar_mapping.core import LidarMapping
from lidar_mapping.settings import MappingSettings
from lidar_obstacles.core import LidarObstacles
from lidar_obstacles.settings import LidarSettings
from perception_core.host import Core, Input
from perception_core.ros.settings import override
from uav_flight.sensor_replay.faults import TOPICS, Faults, read_faults
from uav_flight.sensor_replay.host import CALLS, BagHost, Timeline
from uav_flight.sensor_replay.nodes import NODES, node_and_parameter
from zed_depth.core import ZedDepth
from zed_depth.settings import ZedSettings

AGAIN = ("/perception/transition", "/mapping/transition")
"""Calls that the nodes make again."""
MEASURED = {
    "zed_status": ("/zed/left/image_raw", "/zed/right/image_raw"),
    "lidar_status": ("/lidar/points",),
    "slam_status": ("/lidar/points",),
}
"""What the nodes judge these resources by."""


class PerceptionError(Exception):
    """A bag can't be perceived again; the message says why, in one line."""


def settings_of(texts: Sequence[str]) -> dict[str, dict[str, object]]:
    """Read ``NODE.NAME=VALUE`` into parameters by node; raises PerceptionError."""
    found: dict[str, dict[str, object]] = {}
    for text in texts:
        node, parameter = node_and_parameter(text)
        if node not in NODES or not parameter:
            raise PerceptionError(f"--set {text}: write NODE.NAME=VALUE; nodes are {', '.join(NODES)}")
        found.setdefault(node, {})[parameter] = yaml.safe_load(text.partition("=")[2])
    return found


def lift_off_of(bag: rosbag.Bag) -> int:
    """Return when flight_status became IN_AIR first, nanoseconds; 0 where it never did."""
    for _, message, _ in bag.read_messages(topics=[CALLS]):
        call = json.loads(message.data)
        if call["request"].get("resource") == "flight_status" and call["request"].get("to") == "IN_AIR":
            return round(float(call["end_s"]) * 1e9)
    return 0


def begins_of(bag: rosbag.Bag, names: Mapping[str, str]) -> dict[str, int]:
    """Return when a bag's measurements for each resource begin, nanoseconds; resources without measurements are missing.

    ``names``: what topics of the bag are called here.
    """
    first = {}
    for topic in bag.get_type_and_topic_info().topics:
        if names.get(topic, topic) in TOPICS:
            first[names.get(topic, topic)] = next(time for _, _, time in bag.read_messages(topics=[topic], raw=True)).to_nsec()
    return {resource: max(first[topic] for topic in topics) for resource, topics in MEASURED.items() if first.keys() >= set(topics)}


class Perception:
    """Feeds the cores from one bag, and writes the other; ``names``: what topics of the source are called here."""

    def __init__(
        self,
        source: rosbag.Bag,
        target: rosbag.Bag,
        faults: Faults,
        parameters: dict[str, dict[str, object]],
        names: Mapping[str, str],
    ) -> None:
        self._source = source
        self._target = target
        self._names = names
        self._faults = faults
        self._begins = begins_of(source, names)
        self._parameters = parameters
        self._timeline = Timeline()
        self._cores: dict[str, Core] = {}
        self._inputs: dict[str, list[Input]] = {}

    def run(self) -> None:
        """Give every recorded measurement to the cores, in the order of the bag."""
        with tempfile.TemporaryDirectory() as folder:
            self._timeline.now_ns = round(self._source.get_start_time() * 1e9)
            self._make_cores(str(Path(folder) / "map.ply"))
            for topic, (kind, data, *_, message_class), time in self._source.read_messages(raw=True):
                self._timeline.advance_to(time.to_nsec())
                self._take(self._names.get(topic, topic), kind, data, message_class)

    def _make_cores(self, map_path: str) -> None:
        zed = override(ZedSettings(), self._parameters.get("zed_depth", {}))
        lidar = override(LidarSettings(), self._parameters.get("lidar_obstacles", {}))
        mapping = override(MappingSettings(map_path=map_path), self._parameters.get("lidar_mapping", {}))
        self._add("zed_depth", ZedDepth(zed, self._host("zed_depth", "perception")))
        self._add("lidar_obstacles", LidarObstacles(lidar, self._host("lidar_obstacles", "perception")))
        self._add("lidar_mapping", LidarMapping(mapping, self._host("lidar_mapping", "mapping")))

    def _host(self, name: str, skillset: str) -> BagHost:
        return BagHost(name, skillset, self._timeline, self._publish)

    def _add(self, name: str, core: Core) -> None:
        self._cores[name] = core
        for each in core.inputs:
            self._inputs.setdefault(each.topic, []).append(each)
        for period_s, work in core.timers:
            self._timeline.every(period_s, work)

    def _take(self, topic: str, kind: str, data: bytes, message_class: Any) -> None:
        now_ns = self._timeline.now_ns
        if topic in TOPICS:
            for message, at_ns in self._faults.arriving(topic, message_class().deserialize(data), now_ns):
                wire = BytesIO()
                message.serialize(wire)
                self._timeline.after((at_ns - now_ns) / 1e9, functools.partial(self._deliver, topic, kind, wire.getvalue()))
            self._timeline.advance_to(now_ns)
        elif topic == CALLS:
            self._take_call(message_class().deserialize(data))
        elif not topic.startswith(tuple(f"/{name}/" for name in NODES)):
            self._target.write(topic, message_class().deserialize(data), self._time())
            self._deliver(topic, kind, data)

    def _deliver(self, topic: str, kind: str, data: bytes) -> None:
        for each in self._inputs.get(topic, ()):
            each.take_bytes(kind, data)

    def _take_call(self, message: Any) -> None:
        call = json.loads(message.data)
        if call["service"] in AGAIN and not self._came_before(call):
            return
        self._target.write(CALLS, message, self._time())
        node, _, service = call["service"].removeprefix("/").rpartition("/")
        if service == "enable" and node in self._cores:
            self._cores[node].switch(bool(call["request"]["data"]))

    def _came_before(self, call: Mapping[str, Any]) -> bool:
        """Tell whether a node has judged by measurements that the bag does not hold: the recorder begins later than the flight."""
        return self._timeline.now_ns < self._begins.get(call["request"].get("resource"), 0)

    def _publish(self, topic: str, message: Any) -> None:
        if topic != "/tf":  # what the recording has there is written
            self._target.write(topic, message, self._time())

    def _time(self) -> rospy.Time:
        return rospy.Time(self._timeline.now_ns // 1_000_000_000, self._timeline.now_ns % 1_000_000_000)


def main(words: Sequence[str] | None = None) -> int:
    """Perceive again; return the exit code."""
    parser = argparse.ArgumentParser(prog="uav_flight.sensor_replay", description="Perceive a recorded flight again.")
    parser.add_argument("bag", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--fail", action="append", default=[])
    parser.add_argument("--map", action="append", default=[], dest="names", metavar="THEIRS:=OURS")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    options = parser.parse_args(words)
    try:
        perceive(options.bag, options.out, options.fail, options.settings, options.names)
    except (PerceptionError, FaultError, rosbag.ROSBagException, OSError, ValueError) as error:
        sys.stderr.write(f"{str(error) or type(error).__name__}\n".replace("\n", " ").strip() + "\n")
        return 2
    return 0


def names_of(texts: Sequence[str]) -> dict[str, str]:
    """Read ``THEIRS:=OURS``; raises PerceptionError."""
    pairs = [text.split(":=") for text in texts]
    for text, pair in zip(texts, pairs, strict=True):
        if len(pair) != 2 or not all(name.startswith("/") for name in pair):
            raise PerceptionError(f"--map {text}: write /THEIRS:=/OURS; topics of measurements here are {', '.join(TOPICS)}")
    return {pair[0]: pair[1] for pair in pairs}


def perceive(source: Path, target: Path, fail: Sequence[str], settings: Sequence[str], maps: Sequence[str] = ()) -> None:
    """Write ``target``: the bag ``source`` with what the perception says of its measurements now.

    Raises:
        PerceptionError: there are no measurements in it, or a setting does not exist.
        FaultError: there is no such failure.
    """
    requests, parameters, names = read_faults(fail), settings_of(settings), names_of(maps)
    with rosbag.Bag(str(source)) as bag:
        topics = {names.get(topic, topic) for topic in bag.get_type_and_topic_info().topics}
        if not topics & (TOPICS.keys() - {"/imu/data"}):
            raise PerceptionError(f"{source}: holds no measurements; record them with ./alula fly SCENARIO --record sensors")
        with rosbag.Bag(str(target), "w") as out:
            Perception(bag, out, Faults(requests, lift_off_of(bag)), parameters, names).run()


if __name__ == "__main__":
    sys.exit(main())
