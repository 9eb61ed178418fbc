"""The mission clock as the supervisor sees it."""

from __future__ import annotations

import time
from typing import Any

STANDSTILL_TIMEOUT_S = 60.0  # wall clock without a tick of the mission clock
START_TIMEOUT_S = 120.0  # wall clock until the mission clock runs


class MissionClock:
    """The last tick of the mission clock, and how long ago it was on the wall."""

    def __init__(self, *, simulated: bool) -> None:
        self._simulated = simulated
        self._now_s: float | None = None
        self._moved = time.monotonic()

    def listen(self) -> None:
        """Subscribe to the clock; only where it is simulated."""
        if not self._simulated:
            return
        import rospy
        from rosgraph_msgs.msg import Clock

        rospy.Subscriber("/clock", Clock, self._tick, queue_size=1)

    def _tick(self, message: Any) -> None:
        self._now_s = message.clock.to_sec()
        self._moved = time.monotonic()

    @property
    def now_s(self) -> float | None:
        """Mission clock in seconds, or None before its first tick."""
        return self._now_s if self._simulated else time.time()

    @property
    def began(self) -> bool:
        """Tell whether there was a tick."""
        return self.now_s is not None

    @property
    def stands_still(self) -> bool:
        """Tell whether the clock has not moved for so long that nothing will move it any more."""
        timeout_s = STANDSTILL_TIMEOUT_S if self.began else START_TIMEOUT_S
        return self._simulated and time.monotonic() - self._moved > timeout_s

    @property
    def standstill(self) -> str:
        """Say how it stands still."""
        if self.began:
            return f"the mission clock stood still for {STANDSTILL_TIMEOUT_S:g} s"
        return f"the mission clock did not begin within {START_TIMEOUT_S:g} s"
