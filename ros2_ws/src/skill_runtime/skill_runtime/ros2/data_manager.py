"""The data manager (paper, section 4.2): keeps what the functional layer publishes, and passes it on latched."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from skillset_interfaces.srv import GetData

from skill_model.model import Data, Skillset
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.plain import carried, message_class, to_plain
from skill_runtime.ros2.names import LATCHED
from skill_runtime.staleness import STALE_PERIODS, is_stale

QUEUE = 10
DataBindings = Mapping[str, tuple[str, str]]
"""Where each data comes from: topic of the functional layer and ROS 2 type, as the generated ``DATA_TOPICS``."""


@dataclass(frozen=True)
class _Received:
    value: Any
    stamp_ns: int


class DataManager:
    """Tells ``update`` of each fresh value, and with None that it has become stale; the data's topics and service ``get_data``."""

    def __init__(self, node: Node, skillset: Skillset, bindings: DataBindings, update: Callable[[str, object | None], None]) -> None:
        missing = [data.name for data in skillset.data if data.name not in bindings]
        if missing:
            raise SkillRuntimeError(f"skillset {skillset.name}: no binding to a topic for data {', '.join(missing)}")
        self._node = node
        self._update = update
        self._data = {data.name: data for data in skillset.data}
        self._received: dict[str, _Received] = {}
        self._lock = threading.Lock()
        for data in skillset.data:
            topic, type_name = bindings[data.name]
            message_type = message_class(type_name)
            publisher = node.create_publisher(message_type, f"{skillset.name}/data/{data.name}", LATCHED)
            node.create_subscription(message_type, topic, self._receiver(data, publisher.publish), QoSProfile(depth=QUEUE))
        node.create_service(GetData, f"{skillset.name}/get_data", self._answer)

    def _receiver(self, data: Data, publish: Callable[[Any], None]) -> Callable[[Any], None]:
        staleness = self._staleness(data)

        def receive(message: Any) -> None:
            with self._lock:
                self._received[data.name] = _Received(message, self._now_ns())
            if staleness is not None:
                staleness.reset()
            publish(message)
            self._update(data.name, carried(data, message))

        return receive

    def _staleness(self, data: Data) -> Any:
        """Return the timer that rings when the data is stale, not yet running; None for data that are never stale."""
        if data.period_s is None:
            return None

        def ring() -> None:
            timer.cancel()
            self._update(data.name, None)

        timer = self._node.create_timer(STALE_PERIODS * data.period_s, ring, autostart=False)
        return timer

    def _now_ns(self) -> int:
        now: int = self._node.get_clock().now().nanoseconds
        return now

    def _stale(self, data: Data, received: _Received) -> bool:
        return is_stale(self._now_ns() - received.stamp_ns, data.period_s)

    def _answer(self, request: Any, response: Any) -> Any:
        data, received = self._data.get(request.name), self._received.get(request.name)
        response.known = data is not None
        if data is not None and received is not None:
            response.received = True
            response.stale = self._stale(data, received)
            response.stamp_ns = received.stamp_ns
            response.value_json = json.dumps(to_plain(received.value))
        return response
