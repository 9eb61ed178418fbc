"""Jobs at times of the mission clock, on one thread: rospy's own timers end for good when simulated time is set back."""

from __future__ import annotations

import heapq
import itertools
import threading
from collections.abc import Callable

import rospy
from rospy.rostime import get_rostime_cond

from skillset_ros1.names import now_ns

LONGEST_WAIT_S = 0.5
Job = Callable[[], None]


class Alarms:
    """Runs each job once, when its time has come; jobs must not wait. ``on_error`` gets what a job raises."""

    def __init__(self, name: str, on_error: Callable[[Exception], None]) -> None:
        self._on_error = on_error
        self._numbers = itertools.count()
        self._waiting: list[tuple[int, int, Job]] = []
        # rospy notifies this one whenever simulated time goes on.
        self._changed = get_rostime_cond()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name=f"{name}_alarms", daemon=True)
        self._thread.start()

    def at(self, due_ns: int, job: Job) -> None:
        """Have ``job()`` run at a time of the mission clock; at once when that has passed."""
        with self._changed:
            heapq.heappush(self._waiting, (due_ns, next(self._numbers), job))
            self._changed.notify_all()

    def after(self, delay_s: float, job: Job) -> None:
        """Have ``job()`` run so many seconds of mission clock from now."""
        self.at(now_ns() + round(delay_s * 1e9), job)

    def close(self) -> None:
        """End the thread; what has not come due never runs."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        if self._thread is not threading.current_thread():
            self._thread.join(LONGEST_WAIT_S)

    def _run(self) -> None:
        while (job := self._next()) is not None:
            try:
                job()
            except Exception as error:  # noqa: BLE001 - others still wait
                self._on_error(error)

    def _next(self) -> Job | None:
        """Wait for the next job; None at the end."""
        with self._changed:
            while not self._ended and not rospy.is_shutdown():
                left_s = (self._waiting[0][0] - now_ns()) * 1e-9 if self._waiting else LONGEST_WAIT_S
                if left_s <= 0:
                    return heapq.heappop(self._waiting)[2]
                self._changed.wait(min(left_s, LONGEST_WAIT_S) if rospy.rostime.is_wallclock() else LONGEST_WAIT_S)
            return None
