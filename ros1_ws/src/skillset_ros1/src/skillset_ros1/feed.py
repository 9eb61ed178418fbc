"""The values of one data of a skillset, as a client follows them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from roslib.message import get_message_class
from skillset_interfaces.srv import GetData, GetDataRequest

from skill_model.model import Data
from skill_runtime.plain import carried
from skill_runtime.samples import SampleFeed
from skill_runtime.views import Sample
from skillset_ros1.names import now_ns
from skillset_ros1.questions import Questions


class TopicFeed(SampleFeed):
    """Follows ``data/<name>``. The type comes with each message, so that no generated code is needed.

    A value is stamped when it arrives; the first one may have been latched for long, so its stamp is asked of the managers.
    """

    def __init__(self, place: str, data: Data, questions: Questions, do: Callable[[Callable[[], None]], None]) -> None:
        super().__init__(data, now_ns)
        self._questions = questions
        topic = f"{place}/data/{data.name}"
        self._subscriber = rospy.Subscriber(topic, rospy.AnyMsg, lambda raw: do(lambda: self._take(raw)), tcp_nodelay=True)

    def ask_stamp(self) -> None:
        """Ask the managers, on a thread of its own."""
        self._questions.ask("get_data", GetData, GetDataRequest(name=self.data.name), self.date)

    def close(self) -> None:
        """Follow it no more."""
        self._subscriber.unregister()

    def _take(self, raw: Any) -> None:
        kind = raw._connection_header["type"]  # noqa: SLF001 - rospy's way to tell
        message_class = get_message_class(kind)
        if message_class is None:
            rospy.logwarn_once(f"data {self.data.name}: no Python package has the type {kind}; its values can't be followed here")
            return
        message = message_class().deserialize(raw._buff)  # noqa: SLF001 - the bytes of an AnyMsg
        self.keep(Sample(carried(self.data, message), None if self.sample is None else now_ns()))
