"""Does a job each time that a period has passed on one of two clocks: the monotonic one, and ROS time where that is simulated.

Who counts a silence does so by the clock that it has: managers of a deployment by the monotonic one, those of a simulation by ``/clock``.
Neither a simulation that creeps, stands or runs ahead nor a wall clock that is set is a silence to any of them.
"""

from __future__ import annotations

import threading
import time
from typing import Callable

import rospy


class PeriodOnEither:
    """Detects that a period has passed on one of two clocks. Times are seconds; each clock may begin anew."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._steady_s = self._ros_s = float("-inf")

    def wait_s(self, steady_s: float, ros_s: float) -> float:
        """Return how long the monotonic clock has yet to pass; 0: a period has passed, and the next one begins."""
        left_s = self._steady_s + self._period_s - steady_s
        if left_s > 0.0 and self._ros_s <= ros_s < self._ros_s + self._period_s:
            return left_s
        self._steady_s, self._ros_s = steady_s, ros_s
        return 0.0


class Beats:
    """Does a job in a thread of its own, at once and from then on each ``period_s`` of either clock, until it is closed."""

    def __init__(self, name: str, period_s: float, job: Callable[[], None]) -> None:
        self._job = job
        self._due = PeriodOnEither(period_s)
        self._ended = threading.Event()
        threading.Thread(target=self._run, name=name, daemon=True).start()

    def close(self) -> None:
        """Stop it; a job under way ends first, and no other one begins."""
        self._ended.set()

    def _run(self) -> None:
        while not (self._ended.is_set() or rospy.is_shutdown()):
            wait_s = self._due.wait_s(time.monotonic(), _simulated_s())
            if wait_s == 0.0:
                self._job()
            elif rospy.rostime.is_wallclock():
                self._ended.wait(wait_s)
            else:
                ticks = rospy.rostime.get_rostime_cond()  # notified at each tick of /clock
                with ticks:
                    ticks.wait(wait_s)


def _simulated_s() -> float:
    """Return simulated time; 0 where ROS time is not simulated."""
    return 0.0 if rospy.rostime.is_wallclock() else rospy.get_time()
