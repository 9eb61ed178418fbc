"""Topics: a route of the data plane each, for either direction."""

from __future__ import annotations

import ctypes
import itertools
from typing import TYPE_CHECKING

from ros_bridge import native
from ros_bridge.config import Direction, Reliability, TopicRoute
from ros_bridge.native import MessageKind
from ros_bridge.native_route import NativeRoute
from ros_bridge.ros1_node import Kind
from ros_bridge.ros2_types import interface_class, type_support_of

if TYPE_CHECKING:
    from ros_bridge.conversion import BytesConverter, TypePair
    from ros_bridge.routes import Context, TopicBridge


class NativeTopic(NativeRoute):
    """One route."""

    def __init__(self, spec: TopicRoute, pair: TypePair, context: Context) -> None:
        """Open the end that offers; raises BridgeError."""
        super().__init__(context.plane, spec.label)
        self._spec = spec
        self._pair = pair
        self._to_ros2 = spec.direction is Direction.ROS1_TO_ROS2
        if not pair.same_layout:
            self._convert_in_python({MessageKind.MESSAGE: pair.to_ros2_layout if self._to_ros2 else self._numbered_to_ros1()})
        type_support = type_support_of(interface_class(pair.ros2_name, "msg"))
        with context.node.handle:
            specification = native.Specification(
                ros1_topic=spec.ros1_name.encode(),
                ros1_type=pair.ros1_name.encode(),
                md5sum=pair.md5sum.encode(),
                definition=pair.full_text.encode(),
                ros2_topic=spec.ros2_name.encode(),
                node=context.node.handle.pointer,
                type_support=type_support,
                depth=spec.depth,
                program=native.words_of(pair.program),
                operations=len(pair.program) // 4,
                token=self._token,
                reliable=spec.reliability is Reliability.RELIABLE,
                latched=spec.latched,
                converts=not pair.same_layout,
                bulky=context.types.bulky(pair.ros2_name),
            )
            make = self._native.ros1_to_ros2_new if self._to_ros2 else self._native.ros2_to_ros1_new
            self._handle = self._native.require(make(self._plane.context, ctypes.byref(specification)))
        if not self._to_ros2:
            self._plane.node.register(Kind.PUBLISHER, spec.ros1_name, pair.ros1_name)

    def _numbered_to_ros1(self) -> BytesConverter:
        """Return the converter to ROS 1 that numbers the messages in their headers, as the data plane does with all others."""
        numbers = itertools.count(1)
        return lambda content: self._pair.to_ros1_from_layout(content, seq=next(numbers))

    def start(self) -> None:
        """Subscribe; messages flow from here on."""
        if self._handle is None:
            return
        if self._to_ros2:
            self._plane.links.subscribe(self._spec.ros1_name, self._pair.ros1_name, self._handle)
        else:
            self._native.require(self._native.ros2_to_ros1_start(self._handle))

    def target_peers(self) -> int:
        """Return how many subscribers the end has that messages go out of."""
        with self._lock:
            return 0 if self._handle is None else int(self._native.route_target_peers(self._handle))

    def source_peers(self) -> int:
        """Return how many publishers the end has that messages come from; 0 before ``start``."""
        with self._lock:
            return 0 if self._handle is None else int(self._native.route_source_peers(self._handle))

    def close(self) -> None:
        """Withdraw both ends."""
        if self._handle is None:
            return
        if self._to_ros2:
            self._plane.links.unsubscribe(self._handle)
        else:
            self._plane.node.unregister(Kind.PUBLISHER, self._spec.ros1_name, self._pair.ros1_name)
        self._delete()


def make(spec: TopicRoute, context: Context) -> TopicBridge:
    """Make a topic's route; raises BridgeError when its type can't cross."""
    return NativeTopic(spec, context.types.message(spec.type_name, spec.ros2_type, spec.md5sum), context)
