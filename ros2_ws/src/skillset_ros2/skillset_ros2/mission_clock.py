"""The mission clock of a node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from alula.common.steady_clock import STEADY_CLOCK, SteadyClock
from alula.runtime.mission_clock import MissionClock

STEADY = Clock(clock_type=ClockType.STEADY_TIME)


class NodeClock(MissionClock):
    """The mission clock of a node, and timers that follow it.

    rclpy's own clock and timers follow the wall clock where there is no ``/clock``: when NTP sets that back by an hour, a timer that is due
    twice a second is silent for an hour.

    Args:
        node: whose ``/clock`` it is; a clock that is not rclpy's is taken as it is.
        steady: the clock where the node has no ``/clock``; of the process by default.
    """

    def __init__(self, node: Node, steady: SteadyClock = STEADY_CLOCK) -> None:
        clock: Any = node.get_clock()
        super().__init__(lambda: bool(getattr(clock, "ros_time_is_active", True)), lambda: int(clock.now().nanoseconds), steady)
        self._node = node

    def every(self, period_s: float, job: Callable[[], object], **options: Any) -> Any:
        """Make a timer that does a job each period; ``options`` are those of ``create_timer``."""
        return self._node.create_timer(period_s, job, **options if self.simulated else {**options, "clock": STEADY})
