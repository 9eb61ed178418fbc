"""The thread on which everything of one side of a skillset happens: jobs as they come, and jobs at moments of either clock."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

import rospy
from rospy.rostime import get_rostime_cond

from alula.runtime.timers import Job, Timer, TimerQueue
from alula.runtime.waiting import CannotWaitError
from skillset_ros1.names import mission_clock

LONGEST_WAIT_S = 0.25
"""So soon a loop sees that the node was shut down."""
END_S = 1.0


class Loop:
    """Runs until it is closed or the node is shut down; what a job raises goes to ``on_error``, and ends nothing.

    rospy's own timers end for good when simulated time is set back, and all its callbacks come on threads of their own.
    """

    def __init__(self, name: str, on_error: Callable[[Exception], None]) -> None:
        self.on_end: Job = _nothing
        """Called on the thread when it ends."""
        self._name = name
        self._on_error = on_error
        self._jobs: deque[Job] = deque()
        self._clock = mission_clock()
        self._timers = TimerQueue()
        self._delays = TimerQueue()
        # rospy notifies this one whenever simulated time goes on.
        self._changed = get_rostime_cond()
        self._over = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, job: Job) -> bool:
        """Run a job, soon; False when it is too late for that, and the job is not run."""
        with self._changed:
            if not self._over:
                self._jobs.append(job)
                self._changed.notify_all()
            return not self._over

    def at(self, when_ns: int, job: Job) -> Timer:
        """Run a job at a moment of the mission clock; soon, when that has passed."""
        return self._put(self._timers, when_ns, job)

    def after(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay of wall clock."""
        return self._put(self._delays, time.monotonic_ns() + round(delay_s * 1e9), job)

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait for an event that this thread brings; None: until it comes or can't come any more.

        Raises:
            CannotWaitError: the caller is on this thread, or it has ended.
        """
        if threading.current_thread() is self._thread:
            raise CannotWaitError("this thread delivers the skillset's messages and can't wait for them: use a callback, or another thread")
        end_s = float("inf") if timeout_s is None else time.monotonic() + timeout_s
        while not event.wait(min(LONGEST_WAIT_S, max(0.0, end_s - time.monotonic()))):
            if time.monotonic() >= end_s:
                return False
            if timeout_s is None and not self._thread.is_alive():
                raise CannotWaitError(f"{self._name} was closed; nothing comes any more")
        return True

    def close(self) -> None:
        """End, after the jobs that are there; wait for that unless called on this thread."""
        with self._changed:
            self._over = True
            self._changed.notify_all()
        if self._thread is not threading.current_thread():
            self._thread.join(END_S)

    # --- inside ------------------------------------------------------------------------------------------------------

    def _put(self, timers: TimerQueue, when_ns: int, job: Job) -> Timer:
        with self._changed:
            timer = timers.put(when_ns, job)
            if timers.is_next(timer):
                self._changed.notify_all()
        return timer

    def _run(self) -> None:
        while (job := self._next()) is not None:
            try:
                job()
            except Exception as error:  # noqa: BLE001 - others still wait
                self._on_error(error)
        self.on_end()

    def _next(self) -> Job | None:
        """Wait for the next job; None at the end."""
        with self._changed:
            while not rospy.is_shutdown():
                if self._jobs:
                    return self._jobs.popleft()
                if self._over:
                    return None
                due = self._delays.pop_due(time.monotonic_ns()) or self._timers.pop_due(self._clock.now_ns())
                if due is not None:
                    return due[1]
                self._changed.wait(self._pause_s())
            self._over = True
            return None

    def _pause_s(self) -> float:
        """Return until when nothing is to do by time alone; a simulated clock tells of its steps itself."""
        pauses = [LONGEST_WAIT_S]
        if self._delays.due_ns is not None:
            pauses.append((self._delays.due_ns - time.monotonic_ns()) * 1e-9)
        if self._timers.due_ns is not None and not self._clock.simulated:
            pauses.append((self._timers.due_ns - self._clock.now_ns()) * 1e-9)
        return max(0.0, min(pauses))


def _nothing() -> None:
    """Do nothing at the end."""
