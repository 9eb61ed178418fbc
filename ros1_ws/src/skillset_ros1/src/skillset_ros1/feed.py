"""The values of one data of a skillset, as a client follows them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import rospy
from roslib.message import get_message_class
from skillset_interfaces.srv import GetData, GetDataRequest

from skill_language.model import Data
from skill_language.ros_types import PRIMITIVES
from skill_runtime.staleness import is_stale
from skill_runtime.views import Forget, Sample
from skillset_ros1.names import now_ns
from skillset_ros1.questions import Questions


class TopicFeed:
    """Follows ``data/<name>``. The type comes with each message, so that no generated code is needed.

    A value is stamped when it arrives; the first one may have been latched for long, so its stamp is asked of the managers.
    """

    def __init__(self, place: str, data: Data, questions: Questions, do: Callable[[Callable[[], None]], None]) -> None:
        self._data = data
        self._questions = questions
        self._lock = threading.Lock()
        self._callbacks: list[Callable[[Sample], None]] = []
        self._sample: Sample | None = None
        topic = f"{place}/data/{data.name}"
        self._subscriber = rospy.Subscriber(topic, rospy.AnyMsg, lambda raw: do(lambda: self._take(raw)), tcp_nodelay=True)

    @property
    def sample(self) -> Sample | None:
        """The last value; None before the first."""
        return self._sample

    @property
    def stale(self) -> bool:
        """Tell whether there is no value, or it is older than the model's period allows."""
        sample = self._sample
        return sample is None or (sample.stamp_ns is not None and is_stale(now_ns() - sample.stamp_ns, self._data.period_s))

    def on_sample(self, callback: Callable[[Sample], None]) -> Forget:
        """Have ``callback(sample)`` called for each value from now on."""
        with self._lock:
            self._callbacks.append(callback)

        def forget() -> None:
            with self._lock:
                if callback in self._callbacks:
                    self._callbacks.remove(callback)

        return forget

    def close(self) -> None:
        """Follow it no more."""
        self._subscriber.unregister()

    def _take(self, raw: Any) -> None:
        kind = raw._connection_header["type"]  # noqa: SLF001 - rospy's way to tell
        message_class = get_message_class(kind)
        if message_class is None:
            rospy.logwarn_once(f"data {self._data.name}: no Python package has the type {kind}; its values can't be followed here")
            return
        message = message_class().deserialize(raw._buff)  # noqa: SLF001 - the bytes of an AnyMsg
        first = self._sample is None
        sample = Sample(message.data if self._data.type in PRIMITIVES else message, None if first else now_ns())
        with self._lock:
            self._sample = sample
            callbacks = list(self._callbacks)
        if first:
            self._questions.ask("get_data", GetData, GetDataRequest(name=self._data.name), self._date)
        for callback in callbacks:
            callback(sample)

    def _date(self, response: Any) -> None:
        """Take the stamp of the value that was there when this client came."""
        with self._lock:
            if response.received and self._sample is not None and self._sample.stamp_ns is None:
                self._sample = Sample(self._sample.value, response.stamp_ns)
