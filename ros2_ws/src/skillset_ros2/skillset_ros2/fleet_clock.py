"""One mission clock for the robots of a fleet, each of which has a clock of its own."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

NANOSECONDS = 1_000_000_000


class FleetClock:
    """Publishes ``clock`` in the fleet's namespace: the clock of the robot that is furthest behind; it never goes back.

    It begins when the clock of every robot has begun. One whose clock nobody publishes any more is not waited for.
    """

    def __init__(self, node: Node, robots: Sequence[str]) -> None:
        """Follow the clocks of these namespaces."""
        self._node = node
        self._at_ns: dict[str, int | None] = dict.fromkeys(robots)
        self._now_ns = 0
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        # Reliable for the bridge, which asks for that; who wants less gets less.
        self._publisher = node.create_publisher(Clock, "clock", 10)
        for robot in robots:
            node.create_subscription(Clock, f"{robot}/clock", partial(self._hear, robot), newest)

    def _hear(self, robot: str, message: Clock) -> None:
        self._at_ns[robot] = message.clock.sec * NANOSECONDS + message.clock.nanosec
        self._tell()

    def look(self) -> None:
        """Leave out the robots whose clocks have ended; to be called now and then."""
        told = [robot for robot, at_ns in self._at_ns.items() if at_ns is not None]
        gone = [robot for robot in told if not self._node.count_publishers(f"{robot}/clock")]
        for robot in gone if len(gone) < len(self._at_ns) else ():
            del self._at_ns[robot]
            self._node.get_logger().warning(f"the mission clock does not wait for {robot} any more: its clock has ended")
        self._tell()

    def _tell(self) -> None:
        known = [at_ns for at_ns in self._at_ns.values() if at_ns is not None]
        if len(known) == len(self._at_ns) and min(known) > self._now_ns:
            self._now_ns = min(known)
            self._publisher.publish(Clock(clock=Time(sec=self._now_ns // NANOSECONDS, nanosec=self._now_ns % NANOSECONDS)))
