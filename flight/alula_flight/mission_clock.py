"""The mission clock as the supervisor sees it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from alula.common.steady_clock import STEADY_CLOCK

STANDSTILL_TIMEOUT_S = 60.0  # wall clock without a tick of the mission clock
START_TIMEOUT_S = 120.0  # wall clock until the mission clock runs


class MissionClock:
    """The last tick of the mission clock, and how long ago it was on the wall. It is ``/clock`` where the launch file says so."""

    def __init__(self) -> None:
        self._simulated: bool | None = None
        self._now_s: float | None = None
        self._moved = time.monotonic()
        self._ticked: Callable[[float], None] = lambda _: None

    def listen(self, ticked: Callable[[float], None]) -> None:
        """Follow it, and tell of each tick of ``/clock``; the launch file's parameters must be set."""
        import rospy
        from rosgraph_msgs.msg import Clock

        self.begin(simulated=bool(rospy.get_param("/use_sim_time", False)))
        self._ticked = ticked
        if self.simulated:
            rospy.Subscriber("/clock", Clock, self._tick, queue_size=1)

    def begin(self, *, simulated: bool) -> None:
        """Be ``/clock``, or the wall clock without its steps."""
        self._simulated, self._moved = simulated, time.monotonic()

    @property
    def simulated(self) -> bool:
        """Return whether it is known to be ``/clock``."""
        return bool(self._simulated)

    def _tick(self, message: Any) -> None:
        now_s = self._now_s = float(message.clock.to_sec())
        self._moved = time.monotonic()
        self._ticked(now_s)

    @property
    def now_s(self) -> float | None:
        """Mission clock in seconds, or None before it is known."""
        return STEADY_CLOCK.now_ns() / 1e9 if self._simulated is False else self._now_s

    @property
    def began(self) -> bool:
        """Return whether it is known."""
        return self.now_s is not None

    @property
    def stands_still(self) -> bool:
        """Return whether the clock has not moved for so long that nothing will move it any more."""
        timeout_s = STANDSTILL_TIMEOUT_S if self.began else START_TIMEOUT_S
        return self.simulated and time.monotonic() - self._moved > timeout_s

    @property
    def standstill(self) -> str:
        """Return for how long it has stood still, or not begun, in words."""
        if self.began:
            return f"the mission clock stood still for {STANDSTILL_TIMEOUT_S:g} s"
        return f"the mission clock did not begin within {START_TIMEOUT_S:g} s"
