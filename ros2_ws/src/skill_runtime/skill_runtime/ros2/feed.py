"""The values of one data of a skillset, as a client follows them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from skillset_interfaces.srv import GetData

from skill_language.model import Data
from skill_language.ros_types import PRIMITIVES
from skill_runtime.plain import message_class
from skill_runtime.ros2.names import LATCHED
from skill_runtime.ros2.questions import Questions
from skill_runtime.staleness import is_stale
from skill_runtime.views import Forget, Sample


class TopicFeed:
    """Follows ``/<skillset>/data/<name>``. The type is asked of the graph, so that no generated code is needed.

    A value is stamped when it arrives; the first one may have been latched for long, so its stamp is asked of the managers.
    """

    def __init__(self, node: Node, root: str, data: Data, group: CallbackGroup, questions: Questions) -> None:
        self._node = node
        self._root = root
        self._data = data
        self._group = group
        self._questions = questions
        self._topic = node.resolve_topic_name(f"{root}/data/{data.name}")
        self._lock = threading.Lock()
        self._callbacks: list[Callable[[Sample], None]] = []
        self._sample: Sample | None = None
        self._subscription: Any = None
        self._unknown_type = ""

    @property
    def restless(self) -> bool:
        """Tell whether ``tick`` has to be called: the topic was not found yet."""
        return self._subscription is None and not self._unknown_type

    @property
    def sample(self) -> Sample | None:
        """The last value; None before the first."""
        return self._sample

    @property
    def stale(self) -> bool:
        """Tell whether there is no value, or it is older than the model's period allows."""
        sample = self._sample
        return sample is None or (sample.stamp_ns is not None and is_stale(self._now_ns() - sample.stamp_ns, self._data.period_s))

    def on_sample(self, callback: Callable[[Sample], None]) -> Forget:
        """Have ``callback(sample)`` called for each value from now on."""
        with self._lock:
            self._callbacks.append(callback)

        def forget() -> None:
            with self._lock:
                if callback in self._callbacks:
                    self._callbacks.remove(callback)

        return forget

    def tick(self) -> None:
        """Look for the topic, and subscribe."""
        kinds = {info.topic_type for info in self._node.get_publishers_info_by_topic(self._topic)}
        if not kinds or self._subscription is not None:
            return
        kind = kinds.pop()
        try:
            message = message_class(kind)
        except (ImportError, AttributeError):
            self._unknown_type = kind
            self._node.get_logger().warning(f"{self._topic}: no Python package has the type {kind}; its values can't be followed here")
            return
        self._subscription = self._node.create_subscription(message, self._topic, self._take, LATCHED, callback_group=self._group)

    def _now_ns(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    def _take(self, message: Any) -> None:
        value = message.data if self._data.type in PRIMITIVES else message
        first = self._sample is None
        self._keep(Sample(value, None if first else self._now_ns()))
        if first:
            self._questions.ask(GetData, f"{self._root}/get_data", GetData.Request(name=self._data.name), self._date)

    def _date(self, response: Any, tries: int) -> None:  # noqa: ARG002
        """Take the stamp of the value that was there when this client came."""
        with self._lock:
            if response.received and self._sample is not None and self._sample.stamp_ns is None:
                self._sample = Sample(self._sample.value, response.stamp_ns)

    def _keep(self, sample: Sample) -> None:
        with self._lock:
            self._sample = sample
            callbacks = list(self._callbacks)
        for callback in callbacks:
            callback(sample)
