"""Topics whose layouts agree: routes of the native data plane."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

from ros_bridge import native
from ros_bridge.config import Direction, Reliability, TopicRoute
from ros_bridge.native_route import NativeRoute

if TYPE_CHECKING:
    from rclpy.node import Node

    from ros_bridge.conversion import TypePair
    from ros_bridge.plane import Plane


class FastTopic(NativeRoute):
    """One route. Its figures stay readable after ``close``."""

    def __init__(self, spec: TopicRoute, pair: TypePair, interface: Any, node: Node, plane: Plane) -> None:
        """Open the end that offers; raises NativeError."""
        super().__init__(plane.native)
        self._spec = spec
        self._pair = pair
        self._plane = plane
        self._node = node
        self._upward = spec.direction is Direction.ROS1_TO_ROS2
        program = native.words_of(pair.program)
        with node.handle:
            specification = native.Specification(
                ros1_topic=spec.ros1_name.encode(),
                ros1_type=pair.ros1_name.encode(),
                md5sum=pair.md5sum.encode(),
                definition=pair.full_text.encode(),
                ros2_topic=spec.ros2_name.encode(),
                node=node.handle.pointer,
                type_support=native.type_support_of(interface),
                depth=spec.depth,
                program=program,
                operations=len(pair.program) // 4,
                token=plane.token(spec.label),
                reliable=spec.reliability is Reliability.RELIABLE,
                latched=spec.latched,
            )
            make = self._native.up_new if self._upward else self._native.down_new
            self._handle = self._native.require(make(plane.machinery, ctypes.byref(specification)))
        if not self._upward:
            plane.node.publish(spec.ros1_name, pair.ros1_name)

    def start(self) -> None:
        """Subscribe; messages flow from here on."""
        if self._handle is None:
            return
        if self._upward:
            self._plane.subscribe(self._spec.ros1_name, self._pair.ros1_name, self._handle)
        else:
            self._native.require(self._native.down_start(self._handle))

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
        if self._upward:
            self._plane.unsubscribe(self._handle)
        else:
            self._plane.node.unpublish(self._spec.ros1_name)
        self._delete()
