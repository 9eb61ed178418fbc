"""What discovery asks about types: which is which in the other world, and whether they can cross; each answer is found once and kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from ros_bridge.errors import BridgeError, TypeUnknownError
from ros_bridge.ros2_types import interface_class

if TYPE_CHECKING:
    from ros_bridge.conversion import Types

Headers = Callable[[str], Iterable[dict[str, str]]]
Pair = tuple[str, str]


class CheckedTypes:
    """The types that cross, each pair checked once; what ``decisions.decide`` asks of types."""

    def __init__(self, types: Types, headers: Headers) -> None:
        """``headers`` asks the ROS 1 publishers of a topic for their connection headers; it may take a second each."""
        self._types = types
        self._headers = headers
        self._kept: dict[tuple[str, str, str], BridgeError | None] = {}

    def pair(self, ros1_type: str | None, ros2_type: str | None, topic: str) -> Pair:
        """Complete a pair of which one may be unknown, and check that its messages can cross; raises BridgeError."""
        pair = self._complete(ros1_type, ros2_type)
        if ("msg", *pair) not in self._kept and not self._types.knows_ros1(pair[0]):
            for header in self._headers(topic):
                if header.get("type") == pair[0] and header.get("message_definition"):
                    self._types.learn(pair[0], header["message_definition"])
                    break
        self._check("msg", pair, self._types.message)
        return pair

    def check_service(self, ros1_type: str | None, ros2_type: str | None) -> Pair:
        """Do the same for a service."""
        pair = self._complete(ros1_type, ros2_type)
        self._check("srv", pair, self._types.service)
        return pair

    def bulky(self, ros2_type: str) -> bool:
        """Tell whether messages of a type that has been checked can be large."""
        return self._types.bulky(ros2_type)

    def _complete(self, ros1_type: str | None, ros2_type: str | None) -> Pair:
        if ros1_type is not None:
            return ros1_type, ros2_type or self._types.rules.to_ros2(ros1_type)
        if ros2_type is not None:
            return self._types.rules.to_ros1(ros2_type), ros2_type
        raise TypeUnknownError("its node does not say its type")

    def _check(self, kind: str, pair: Pair, load: Callable[[str, str], object]) -> None:
        key = (kind, *pair)
        if key not in self._kept:
            try:
                load(*pair)
                interface_class(pair[1], kind)
                self._kept[key] = None
            except BridgeError as error:
                self._kept[key] = error
        if (problem := self._kept[key]) is not None:
            raise problem
