"""Feeds the cores from one bag, and writes the other: the record with the cores' messages of now in place of those of then."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import rosbag
import rospy

from alula.common.faults import FaultRequest
from node_core.core import Input, Switched
from node_core.replay.host import CALLS, BagHost, Timeline
from node_core.replay.part import Arrival, ReplayPartError, SensorPart

if TYPE_CHECKING:
    from node_core.core import Core, Host, Output


@dataclass(frozen=True)
class Conditions:
    """The conditions of a replay.

    Attributes:
        fail: measurements that fail, from ``zero_s`` of mission clock on.
        parameters: by node.
        names: what topics of the bag are called here.
        initial: the states in which resources begin, by ``skillset.resource``.
        world: the file of the world.
    """

    fail: Sequence[FaultRequest] = ()
    zero_s: float = 0.0
    parameters: Mapping[str, dict[str, object]] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    initial: Mapping[str, str] = field(default_factory=dict)
    world: Path | None = None


class Perceiving:
    """One bag, perceived again; it is the `Replayed` of the robot's part."""

    def __init__(self, part: SensorPart, source: rosbag.Bag, target: rosbag.Bag, given: Conditions, folder: Path) -> None:
        self.folder, self.world = folder, given.world
        self._part, self._source, self._target, self._given = part, source, target, given
        self._begins = dict(self._begins_of())
        self._timeline = Timeline()
        self._hosts: list[BagHost] = []
        self._inputs: dict[str, list[Input]] = {}
        self._heard: dict[str, Callable[[Any], bool]] = {}
        self._last: dict[str, Any] = {}
        self._rng = np.random.default_rng(0)
        self._cores: Mapping[str, Core] = {}

    def run(self) -> None:
        """Feed every recorded measurement to the cores, in the order of the bag; raises ReplayPartError."""
        self._timeline.now_ns = round(self._source.get_start_time() * 1e9)
        self._cores = self._part.make(self)
        for core in self._cores.values():
            for each in core.inputs:
                self._inputs.setdefault(each.topic, []).append(each)
            for period_s, work in core.timers:
                self._timeline.every(period_s, work)
        self._check_types()
        again = {topic for host in self._hosts for topic in host.topics}
        for topic, (kind, data, *_, message_class), time in self._source.read_messages(raw=True):
            self._timeline.advance_to(time.to_nsec())
            name = self._given.names.get(topic, topic)
            if name not in again:
                self._take(name, kind, data, message_class)

    def _check_types(self) -> None:
        """Refuse a topic of another type than the nodes take: in a replay it is a wrong name, not a driver that fails."""
        for topic, told in self._source.get_type_and_topic_info().topics.items():
            name = self._given.names.get(topic, topic)
            wanted = {each.kind._type for each in self._inputs.get(name, ())}  # noqa: SLF001 -- generated messages have it
            if wanted - {told.msg_type}:
                of = f"{topic} (--map {topic}:={name})" if topic != name else topic
                raise ReplayPartError(f"{self._source.filename}: {of} is of type {told.msg_type}, expected {' or '.join(sorted(wanted))}")

    # --- what the part asks of it -------------------------------------------------------------------------------------

    def host(self, name: str, outputs: Sequence[Output]) -> Host:
        """Return the host of the core of a node."""
        self._hosts.append(BagHost(name, outputs, self._given.initial, self._timeline, self._say))
        return self._hosts[-1]

    def settings(self, name: str) -> dict[str, object]:
        """Return the parameters of a node that were given."""
        return self._given.parameters.get(name, {})

    def hear(self, topic: str, take: Callable[[Any], bool]) -> None:
        """Call ``take`` with the recorded messages of a topic; those for which it returns false are not in the new bag."""
        self._heard[topic] = take

    def publish(self, topic: str, message: Any) -> None:
        """Write a message into the new bag."""
        now_ns = self._timeline.now_ns
        self._target.write(topic, message, rospy.Time(now_ns // 1_000_000_000, now_ns % 1_000_000_000))

    # --- what was recorded --------------------------------------------------------------------------------------------

    def _take(self, topic: str, kind: str, data: bytes, message_class: Any) -> None:
        message = message_class().deserialize(data)
        if topic == CALLS:
            self._take_call(message)
        elif topic in self._part.measured:
            now_ns = self._timeline.now_ns
            for arriving, at_ns in self._arriving(topic, message, now_ns):
                wire = BytesIO()
                arriving.serialize(wire)
                self._timeline.after((at_ns - now_ns) / 1e9, functools.partial(self._arrive, topic, kind, wire.getvalue(), message_class))
            self._timeline.advance_to(now_ns)
        elif topic not in self._heard or self._heard[topic](message):
            self.publish(topic, message)
            self._deliver(topic, kind, data)

    def _arrive(self, topic: str, kind: str, data: bytes, message_class: Any) -> None:
        if topic not in self._part.left_out:
            self.publish(topic, message_class().deserialize(data))
        self._deliver(topic, kind, data)

    def _deliver(self, topic: str, kind: str, data: bytes) -> None:
        for each in self._inputs.get(topic, ()):
            each.take_bytes(kind, data)

    def _arriving(self, topic: str, message: Any, now_ns: int) -> Iterable[tuple[Any, int]]:
        """Return what arrives in place of a message, and when."""
        sensor = self._part.measured[topic]
        failing = ""
        for request in self._given.fail:
            if request.what == sensor and request.lasts(now_ns / 1e9 - self._given.zero_s):
                failing = request.how or next(iter(self._part.ways[sensor]))
        if not failing:
            self._last[topic] = message
            return ((message, now_ns),)
        return self._part.ways[sensor][failing](Arrival(topic, message, now_ns, self._last.get(topic), self._rng))

    def _say(self, topic: str, message: Any) -> None:
        """Write a core's message, and pass it to the cores that subscribe to it, once this one is done."""
        self.publish(topic, message)
        if topic in self._inputs:
            wire = BytesIO()
            message.serialize(wire)
            self._timeline.after(0.0, functools.partial(self._deliver, topic, message._type, wire.getvalue()))  # noqa: SLF001 -- generated

    def _take_call(self, message: Any) -> None:
        call = json.loads(message.data)
        place, _, service = call["service"].removeprefix("/").rpartition("/")
        resource = f"{place}.{call['request'].get('resource')}"
        if service == "transition" and resource in self._part.reports and not self._came_before(resource):
            return
        self.publish(CALLS, message)
        core: object = self._cores.get(place)
        if service == "enable" and isinstance(core, Switched):
            core.switch(bool(call["request"]["data"]))

    def _came_before(self, resource: str) -> bool:
        """Return whether a node has judged by measurements that the bag does not hold: the recorder begins later than the robot."""
        return self._timeline.now_ns < self._begins.get(resource, 0)

    def _begins_of(self) -> Iterator[tuple[str, int]]:
        """Yield when a bag's measurements for each resource begin, nanoseconds; resources without measurements are missing."""
        first = {}
        for topic in self._source.get_type_and_topic_info().topics:
            name = self._given.names.get(topic, topic)
            if name in self._part.measured:
                first[name] = next(time for _, _, time in self._source.read_messages(topics=[topic], raw=True)).to_nsec()
        for resource, topics in self._part.reports.items():
            if first.keys() >= set(topics):
                yield resource, max(first[topic] for topic in topics)
