"""Topics whose layouts agree: routes of the native data plane."""

from __future__ import annotations

import ctypes
import threading
from typing import TYPE_CHECKING, Any

from ros_bridge import native
from ros_bridge.config import Direction, Reliability, TopicRoute
from ros_bridge.stats import Durations, Figures

if TYPE_CHECKING:
    from rclpy.node import Node

    from ros_bridge.conversion import TypePair
    from ros_bridge.plane import Plane

SLOW_SUBSCRIBER = "a subscriber in ROS 1 does not keep up"
OVERRUN = "arrived faster than they crossed"


class FastTopic:
    """One route. Its figures stay readable after ``close``."""

    def __init__(self, spec: TopicRoute, pair: TypePair, interface: Any, node: Node, plane: Plane) -> None:
        """Open the end that offers; raises NativeError."""
        self._spec = spec
        self._pair = pair
        self._plane = plane
        self._node = node
        self._native = plane.native
        self._lock = threading.Lock()
        self._upward = spec.direction is Direction.ROS1_TO_ROS2
        self._last = native.RouteFigures()
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
            self._route: int | None = self._native.require(make(plane.machinery, ctypes.byref(specification)))
        if not self._upward:
            plane.node.publish(spec.ros1_name, pair.ros1_name)

    def start(self) -> None:
        """Subscribe; messages flow from here on."""
        if self._route is None:
            return
        if self._upward:
            self._plane.subscribe(self._spec.ros1_name, self._pair.ros1_name, self._route)
        else:
            self._native.require(self._native.down_start(self._route))

    def target_peers(self) -> int:
        """Return how many subscribers the end has that messages go out of."""
        with self._lock:
            return 0 if self._route is None else int(self._native.route_target_peers(self._route))

    def source_peers(self) -> int:
        """Return how many publishers the end has that messages come from; 0 before ``start``."""
        with self._lock:
            return 0 if self._route is None else int(self._native.route_source_peers(self._route))

    def figures(self) -> Figures:
        """Return what has crossed."""
        counters = self._counters()
        durations = Durations.of(counters.bins)
        dropped = {SLOW_SUBSCRIBER: int(counters.dropped_slow), OVERRUN: int(counters.dropped_overrun)}
        return Figures(
            count=int(counters.count),
            bytes=int(counters.bytes),
            p50_ms=durations.percentile_ms(0.50),
            p95_ms=durations.percentile_ms(0.95),
            dropped={reason: number for reason, number in dropped.items() if number},
            errors=int(counters.errors),
        )

    def _counters(self) -> native.RouteFigures:
        with self._lock:
            if self._route is not None:
                self._native.route_figures(self._route, ctypes.byref(self._last))
            return self._last

    def close(self) -> None:
        """Withdraw both ends."""
        if self._route is None:
            return
        if self._upward:
            self._plane.unsubscribe(self._route)
        else:
            self._plane.node.unpublish(self._spec.ros1_name)
        self._counters()
        with self._lock:
            route, self._route = self._route, None
            self._native.route_delete(route)
