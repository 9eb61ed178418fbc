"""The values of one data of a skillset, as a client follows them."""

from __future__ import annotations

from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from skillset_interfaces.srv import GetData

from skill_model.model import Data
from skill_runtime.plain import carried, message_class
from skill_runtime.ros2.names import LATCHED
from skill_runtime.ros2.questions import Questions
from skill_runtime.samples import SampleFeed
from skill_runtime.views import Sample


class TopicFeed(SampleFeed):
    """Follows ``/<skillset>/data/<name>``. The type is asked of the graph, so that no generated code is needed.

    A value is stamped when it arrives; the first one may have been latched for long, so its stamp is asked of the managers.
    """

    def __init__(self, node: Node, root: str, data: Data, group: CallbackGroup, questions: Questions) -> None:
        super().__init__(data, lambda: int(node.get_clock().now().nanoseconds))
        self._node = node
        self._root = root
        self._group = group
        self._questions = questions
        self._topic = node.resolve_topic_name(f"{root}/data/{data.name}")
        self._subscription: Any = None
        self._unknown_type = ""

    @property
    def restless(self) -> bool:
        """Tell whether ``tick`` has to be called: the topic was not found yet."""
        return self._subscription is None and not self._unknown_type

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

    def ask_stamp(self) -> None:
        """Ask the managers, over DDS."""
        request = GetData.Request(name=self.data.name)
        self._questions.ask(GetData, f"{self._root}/get_data", request, lambda answer, _: self.date(answer))

    def _take(self, message: Any) -> None:
        self.keep(Sample(carried(self.data, message), None if self.sample is None else self.now_ns()))
