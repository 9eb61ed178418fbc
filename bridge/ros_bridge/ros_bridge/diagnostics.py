"""The bridge's figures as ``/diagnostics`` (diagnostic_msgs/DiagnosticArray) in both worlds, once a second: a status a route."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from ros_bridge import raw, topics
from ros_bridge.config import Direction, Spec, TopicRoute
from ros_bridge.errors import BridgeError
from ros_bridge.rows import SECTION_OF, quality_text, type_text, up
from ros_bridge.stats import Figures
from ros_bridge.wanted import Decision, Refused

import rospy  # isort: skip - after ros_bridge.raw, which fetches it
from rclpy.serialization import serialize_message  # isort: skip

if TYPE_CHECKING:
    from rclpy.node import Node

    from ros_bridge.conversion import Types

logger = logging.getLogger("ros_bridge")

TOPIC = "/diagnostics"
TYPE = "diagnostic_msgs/DiagnosticArray"
QUEUE = 10
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"


class Diagnostics:
    """The two publishers."""

    def __init__(self, node: Node, types: Types) -> None:
        """Advertise in both worlds; raises BridgeError where diagnostic_msgs is missing."""
        self._pair = types.message(TYPE)
        self._array = topics.interface_class(TYPE, "msg")
        self._status = topics.interface_class("diagnostic_msgs/DiagnosticStatus", "msg")
        self._item = topics.interface_class("diagnostic_msgs/KeyValue", "msg")
        route = TopicRoute(TOPIC, TOPIC, Direction.ROS1_TO_ROS2, TYPE, depth=QUEUE)
        self._ros2 = node.create_publisher(self._array, TOPIC, topics.qos_profile(route))
        self._raw_class = raw.message_class(self._pair)
        self._ros1 = rospy.Publisher(TOPIC, self._raw_class, queue_size=QUEUE)
        self._before: dict[Spec, tuple[int, int]] = {}

    def publish(
        self, figures: Mapping[Spec, Figures], rates: Mapping[Spec, float], failed: Mapping[Spec, str], decisions: Iterable[Decision]
    ) -> None:
        """Publish a status for each route: a warning while it loses messages, an error for one that can't be made."""
        statuses = [self._of_route(spec, one, rates.get(spec, 0.0)) for spec, one in figures.items()]
        statuses += [self._status(level=ERROR, name=f"ros_bridge: {spec.label}", message=reason) for spec, reason in failed.items()]
        statuses += [
            self._status(level=WARN, name=f"ros_bridge: {one.kind} {one.ros1_name}", message=f"not bridged: {one.reason}")
            for one in decisions
            if isinstance(one, Refused)
        ]
        array = self._array(status=statuses)
        array.header.stamp.sec, array.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)  # the bridge has wall time alone
        cdr = serialize_message(array)
        self._ros2.publish(cdr)
        self._ros1.publish(self._raw_class(self._pair.to_ros1(cdr)))

    def _of_route(self, spec: Spec, figures: Figures, rate_hz: float) -> Any:
        lost = (sum(figures.dropped.values()), figures.errors)
        losing = any(now > then for now, then in zip(lost, self._before.get(spec, lost), strict=True))
        self._before[spec] = lost
        values = {
            "direction": "ros1_to_ros2" if up(spec) else "ros2_to_ros1",
            "ros2_name": spec.ros2_name,
            "type": type_text(spec),
            "quality": quality_text(spec),
            "count": figures.count,
            "rate_hz": f"{rate_hz:.2f}",
            "bytes": figures.bytes,
            "p50_ms": "" if figures.p50_ms is None else figures.p50_ms,
            "p95_ms": "" if figures.p95_ms is None else figures.p95_ms,
            "dropped": lost[0],
            "errors": lost[1],
            **{f"dropped: {reason}": number for reason, number in figures.dropped.items()},
        }
        return self._status(
            level=WARN if losing else OK,
            name=f"ros_bridge: {SECTION_OF[type(spec)].removesuffix('s')} {spec.ros1_name}",
            message=f"{rate_hz:.1f} Hz, {figures.count} crossed" + (f", {lost[0]} dropped, {lost[1]} errors" if any(lost) else ""),
            hardware_id="ros_bridge",
            values=[self._item(key=key, value=str(value)) for key, value in values.items()],
        )


def open_diagnostics(node: Node, types: Types) -> Diagnostics | None:
    """Return the publishers, or None where diagnostic_msgs is not installed: bridging does not depend on them."""
    try:
        return Diagnostics(node, types)
    except BridgeError as error:
        logger.warning("there are no diagnostics: %s", error)
        return None
