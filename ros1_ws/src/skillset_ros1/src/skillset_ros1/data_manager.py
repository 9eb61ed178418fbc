"""The data manager (paper, section 4.2) in ROS 1: keeps what the functional layer publishes, and passes it on latched."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import rospy
from skillset_interfaces.srv import GetData, GetDataResponse

from skill_language.model import Data, Skillset
from skill_language.ros_types import PRIMITIVES
from skill_runtime.core.errors import SkillRuntimeError
from skillset_ros1.convert import message_class
from skillset_ros1.names import now_ns
from skillset_ros1.plain import to_plain

STALE_PERIODS = 3.0
"""A value is stale when it is older than so many of the periods that the model promises."""

QUEUE = 10
DataBindings = Mapping[str, tuple[str, str]]
"""Where each data comes from: topic of the functional layer and type, as the generated ``DATA_TOPICS`` (either world's form)."""


@dataclass(frozen=True)
class _Received:
    value: Any
    stamp_ns: int


class DataManager(Mapping[str, object]):
    """The fresh values by name (a mapping, for preconditions), their topics and the service ``get_data``."""

    def __init__(self, place: str, skillset: Skillset, bindings: DataBindings) -> None:
        missing = [data.name for data in skillset.data if data.name not in bindings]
        if missing:
            raise SkillRuntimeError(f"skillset {skillset.name}: no binding to a topic for data {', '.join(missing)}")
        self._data = {data.name: data for data in skillset.data}
        self._received: dict[str, _Received] = {}
        self._lock = threading.Lock()
        self._topics: list[Any] = []
        for name in self._data:
            topic, type_name = bindings[name]
            kind = message_class(type_name)
            publisher = rospy.Publisher(f"{place}/data/{name}", kind, latch=True, queue_size=QUEUE)
            subscriber = rospy.Subscriber(topic, kind, self._receiver(name, publisher.publish), queue_size=QUEUE)
            self._topics += [subscriber, publisher]
        self._service = rospy.Service(f"{place}/get_data", GetData, self._answer)

    def close(self) -> None:
        """Take topics and service away."""
        self._service.shutdown()
        for topic in self._topics:
            topic.unregister()

    def _receiver(self, name: str, publish: Callable[[Any], None]) -> Callable[[Any], None]:
        def receive(message: Any) -> None:
            with self._lock:
                self._received[name] = _Received(message, now_ns())
            publish(message)

        return receive

    @staticmethod
    def _stale(data: Data, received: _Received) -> bool:
        return data.period_s is not None and now_ns() - received.stamp_ns > STALE_PERIODS * data.period_s * 1e9

    def _answer(self, request: Any) -> Any:
        data, received = self._data.get(request.name), self._received.get(request.name)
        response = GetDataResponse(known=data is not None)
        if data is not None and received is not None:
            response.received = True
            response.stale = self._stale(data, received)
            response.stamp_ns = received.stamp_ns
            response.value_json = json.dumps(to_plain(received.value))
        return response

    def _fresh(self) -> dict[str, object]:
        with self._lock:
            received = dict(self._received)
        fresh = {name: value for name, value in received.items() if not self._stale(self._data[name], value)}
        # A primitive comes as std_msgs/Float64 and the like.
        return {name: got.value.data if self._data[name].type in PRIMITIVES else got.value for name, got in fresh.items()}

    def __getitem__(self, name: str) -> object:
        return self._fresh()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._fresh())

    def __len__(self) -> int:
        return len(self._fresh())
