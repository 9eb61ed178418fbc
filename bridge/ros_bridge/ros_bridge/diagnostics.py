"""The bridge's figures as ``/diagnostics`` (diagnostic_msgs/DiagnosticArray) in both worlds, once a second: a status a route."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from rclpy.serialization import serialize_message

from ros_bridge.config import Spec
from ros_bridge.decisions import Decision, Refused
from ros_bridge.endpoints import Ros1Publisher
from ros_bridge.errors import BridgeError
from ros_bridge.ros2_types import interface_class
from ros_bridge.stats import Figures
from ros_bridge.tables import SECTION_OF, quality_text, to_ros2, type_text

if TYPE_CHECKING:
    from ros_bridge.routes import Context

logger = logging.getLogger("ros_bridge")

TOPIC = "/diagnostics"  # in ROS 2 in the node's namespace
TYPE = "diagnostic_msgs/DiagnosticArray"
QUEUE = 10
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"


class Diagnostics:
    """Publishes the routes' figures as diagnostic_msgs/DiagnosticArray, in both worlds."""

    def __init__(self, context: Context) -> None:
        """Advertise in both worlds; raises BridgeError where diagnostic_msgs is missing."""
        self._pair = context.types.message(TYPE)
        self._array = interface_class(TYPE, "msg")
        self._status = interface_class("diagnostic_msgs/DiagnosticStatus", "msg")
        self._item = interface_class("diagnostic_msgs/KeyValue", "msg")
        self._ros2 = context.node.create_publisher(self._array, TOPIC.lstrip("/"), QUEUE)
        self._ros1 = Ros1Publisher(context.plane, TOPIC, self._pair, depth=QUEUE)
        self._before: dict[Spec, tuple[int, int]] = {}

    def publish(
        self, figures: Mapping[Spec, Figures], rates: Mapping[Spec, float], failed: Mapping[Spec, str], decisions: Iterable[Decision]
    ) -> None:
        """Publish a status for each route, if it is heard: a warning while it loses messages, an error for one that can't be made."""
        if not self._ros2.get_subscription_count() and not self._ros1.peers():
            self._before.clear()
            return
        statuses = [self._of_route(spec, one, rates.get(spec, 0.0)) for spec, one in figures.items()]
        statuses += [self._status(level=ERROR, name=f"ros_bridge: {spec.label}", message=reason) for spec, reason in failed.items()]
        statuses += [
            self._status(level=WARN, name=f"ros_bridge: {one.kind} {one.ros1_name}", message=f"not bridged: {one.reason}")
            for one in decisions
            if isinstance(one, Refused)
        ]
        array = self._array(status=statuses)
        array.header.stamp.sec, array.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)  # noqa: TID251 - a stamp; the bridge has wall time alone
        cdr = serialize_message(array)
        self._ros2.publish(cdr)
        self._ros1.publish(self._pair.to_ros1(cdr))

    def _of_route(self, spec: Spec, figures: Figures, rate_hz: float) -> Any:
        lost = (sum(figures.dropped.values()), figures.errors)
        losing = any(now > then for now, then in zip(lost, self._before.get(spec, lost), strict=True))
        self._before[spec] = lost
        values = {
            "direction": "ros1_to_ros2" if to_ros2(spec) else "ros2_to_ros1",
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

    def close(self) -> None:
        """Withdraw the topic from ROS 1."""
        self._ros1.close()


def open_diagnostics(context: Context) -> Diagnostics | None:
    """Return the publishers, or None where diagnostic_msgs is not installed: bridging does not depend on them."""
    try:
        return Diagnostics(context)
    except BridgeError as error:
        logger.warning("there are no diagnostics: %s", error)
        return None
