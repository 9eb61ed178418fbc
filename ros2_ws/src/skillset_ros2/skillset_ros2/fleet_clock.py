"""One mission clock for the robots of a fleet, each of which has a clock of its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

NANOSECONDS = 1_000_000_000
STALLED_S = 30.0
"""Wall clock: a robot whose clock has stood still for so long is not waited for. Robots whose clocks stand still end after 60 s."""


class FleetClock:
    """Publishes ``clock`` in the fleet's namespace: the clock of the robot that is furthest behind; it never goes back.

    It begins when the clock of every robot has begun. One whose clock nobody publishes any more is not waited for; one whose clock
    stands still, after a while, until it goes on: the others have their robots to bring to rest.
    """

    def __init__(self, node: Node, robots: Sequence[str], wall_s: Callable[[], float] = time.monotonic) -> None:
        """Follow the clocks of these namespaces."""
        self._node, self._wall_s = node, wall_s
        self._at_ns: dict[str, int | None] = dict.fromkeys(robots)
        self._moved_s: dict[str, float] = {}  # wall clock
        self._stalled: set[str] = set()
        self._now_ns = 0
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        # Reliable for the bridge, which asks for that; who wants less gets less.
        self._publisher = node.create_publisher(Clock, "clock", 10)
        for robot in robots:
            node.create_subscription(Clock, f"{robot}/clock", partial(self._hear, robot), newest)

    def _hear(self, robot: str, message: Clock) -> None:
        at_ns = message.clock.sec * NANOSECONDS + message.clock.nanosec
        if at_ns != self._at_ns.get(robot):
            self._moved_s[robot] = self._wall_s()
            if robot in self._stalled:
                self._stalled.remove(robot)
                self._node.get_logger().warning(f"the mission clock waits for {robot} again")
        self._at_ns[robot] = at_ns
        self._tell()

    def look(self) -> None:
        """Leave out the robots whose clocks have ended, or stand still for long; to be called now and then while this clock does."""
        told = [robot for robot, at_ns in self._at_ns.items() if at_ns is not None]
        gone = [robot for robot in told if not self._node.count_publishers(f"{robot}/clock")]
        for robot in gone if len(gone) < len(self._at_ns) else ():
            del self._at_ns[robot]
            self._stalled.discard(robot)
            self._node.get_logger().warning(f"the mission clock does not wait for {robot} any more: its clock has ended")
        # Those ahead stand still, too: they wait for the mission.
        holding = {robot for robot, at_ns in self._at_ns.items() if at_ns is not None and at_ns <= self._now_ns} - self._stalled
        stalled = {robot for robot in holding if self._wall_s() - self._moved_s[robot] > STALLED_S}
        for robot in sorted(stalled) if len(self._stalled | stalled) < len(self._at_ns) else ():
            self._stalled.add(robot)
            self._node.get_logger().warning(f"the mission clock does not wait for {robot}: its clock has stood still for {STALLED_S:g} s")
        self._tell()

    def _tell(self) -> None:
        known = [at_ns for robot, at_ns in self._at_ns.items() if at_ns is not None and robot not in self._stalled]
        if len(known) == len(self._at_ns) - len(self._stalled) and min(known) > self._now_ns:
            self._now_ns = min(known)
            self._publisher.publish(Clock(clock=Time(sec=self._now_ns // NANOSECONDS, nanosec=self._now_ns % NANOSECONDS)))
