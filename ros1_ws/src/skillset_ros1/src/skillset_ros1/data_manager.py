"""The data manager (paper, section 4.2) in ROS 1: keeps what the functional layer publishes, and passes it on latched."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import rospy
from skillset_interfaces.srv import GetData, GetDataResponse

from skill_model.model import Data, Skillset
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.plain import carried, message_class, to_plain
from skill_runtime.staleness import STALE_PERIODS, is_stale
from skillset_ros1.alarms import Alarms
from skillset_ros1.names import now_ns

QUEUE = 10
DataBindings = Mapping[str, tuple[str, str]]
"""Where each data comes from: topic of the functional layer and type, as the generated ``DATA_TOPICS`` (either world's form)."""


@dataclass(frozen=True)
class _Received:
    value: Any
    stamp_ns: int


class DataManager:
    """Tells ``update`` of each fresh value, and with None that it has become stale; the data's topics and service ``get_data``."""

    def __init__(
        self, place: str, skillset: Skillset, bindings: DataBindings, update: Callable[[str, object | None], None], alarms: Alarms
    ) -> None:
        missing = [data.name for data in skillset.data if data.name not in bindings]
        if missing:
            raise SkillRuntimeError(f"skillset {skillset.name}: no binding to a topic for data {', '.join(missing)}")
        self._update = update
        self._alarms = alarms
        self._data = {data.name: data for data in skillset.data}
        self._received: dict[str, _Received] = {}
        self._watched: set[str] = set()
        self._lock = threading.Lock()
        self._topics: list[Any] = []
        for data in skillset.data:
            topic, type_name = bindings[data.name]
            kind = message_class(type_name)
            publisher = rospy.Publisher(f"{place}/data/{data.name}", kind, latch=True, queue_size=QUEUE)
            subscriber = rospy.Subscriber(topic, kind, self._receiver(data, publisher.publish), queue_size=QUEUE)
            self._topics += [subscriber, publisher]
        self._service = rospy.Service(f"{place}/get_data", GetData, self._answer)

    def close(self) -> None:
        """Take topics and service away."""
        self._service.shutdown()
        for topic in self._topics:
            topic.unregister()

    def _receiver(self, data: Data, publish: Callable[[Any], None]) -> Callable[[Any], None]:
        def receive(message: Any) -> None:
            received = _Received(message, now_ns())
            with self._lock:
                self._received[data.name] = received
                watch = data.period_s is not None and data.name not in self._watched
                self._watched.add(data.name)
            if watch:
                self._look_at(data, received.stamp_ns)
            publish(message)
            self._update(data.name, carried(data, message))

        return receive

    def _look_at(self, data: Data, stamp_ns: int) -> None:
        """Look, when a value of this age will be stale, whether a fresher one has come; there is one alarm a data at a time."""

        def ring() -> None:
            with self._lock:
                latest = self._received[data.name]
                if stale := latest.stamp_ns <= stamp_ns:
                    self._watched.discard(data.name)
            if not stale:
                self._look_at(data, latest.stamp_ns)
            else:
                self._update(data.name, None)

        self._alarms.at(stamp_ns + round(STALE_PERIODS * (data.period_s or 0.0) * 1e9) + 1, ring)

    def _answer(self, request: Any) -> Any:
        data, received = self._data.get(request.name), self._received.get(request.name)
        response = GetDataResponse(known=data is not None)
        if data is not None and received is not None:
            response.received = True
            response.stale = is_stale(now_ns() - received.stamp_ns, data.period_s)
            response.stamp_ns = received.stamp_ns
            response.value_json = json.dumps(to_plain(received.value))
        return response
