"""The clock by which a silence is measured: monotonic on a robot. In simulation it passes as the slower one of that and ``/clock`` does.

Managers beat by wall clock, so a simulation that runs faster than that is no silence; nor is a machine so slow that its simulation creeps.
"""

from __future__ import annotations

import threading
import time

import rospy

SIMULATED_LOOK_S = 0.05
"""Wall clock; the clock of a simulation counts from look to look, so there is one so often."""


class SlowerClock:
    """Passes as the slower one of two clocks does, from look to look."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._seen_s = (time.monotonic(), 0.0)
        self._now_s = 0.0

    def look(self, *seen_s: float) -> float:
        """Return its time, seconds, when the two clocks have these times."""
        with self._lock:
            passed_s = min(now_s - before_s for now_s, before_s in zip(seen_s, self._seen_s))
            self._seen_s = (seen_s[0], seen_s[1])
            self._now_s += max(0.0, passed_s)
            return self._now_s


_SLOWER = SlowerClock()


def is_simulated() -> bool:
    """Return whether ROS uses simulated time."""
    return not rospy.rostime.is_wallclock()


def now_s() -> float:
    """Return the time in seconds, from an arbitrary zero."""
    return _SLOWER.look(time.monotonic(), rospy.get_time()) if is_simulated() else time.monotonic()
