"""Jobs at moments of a clock of rclpy, done on the executor of a node: one timer, asleep while nothing is due."""

from __future__ import annotations

import heapq
import itertools
import threading
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock
from rclpy.node import Node

from skill_runtime.middleware import Job


class Alarm:
    """A job that waits for its moment."""

    def __init__(self, job: Job) -> None:
        self._job: Job | None = job

    @property
    def pending(self) -> bool:
        """Tell whether the job is still to come."""
        return self._job is not None

    def cancel(self) -> None:
        """Let the job not happen; without effect when it has."""
        self._job = None

    def ring(self) -> None:
        """Do the job, unless it was cancelled."""
        job, self._job = self._job, None
        if job is not None:
            job()


class Alarms:
    """Jobs in the order of their moments, put in from any thread.

    Args:
        node: whose executor does them.
        clock: the moments are of this clock.
        group: of the callbacks.
        on_loop: tells whether the caller is inside a callback of the executor, which sets its timers again afterwards.
    """

    def __init__(self, node: Node, clock: Clock, group: CallbackGroup, on_loop: Callable[[], bool]) -> None:
        self._clock = clock
        self._on_loop = on_loop
        self._lock = threading.Lock()
        self._numbers = itertools.count()
        self._waiting: list[tuple[int, int, Alarm]] = []
        self._timer: Any = node.create_timer(1.0, self._ring, callback_group=group, clock=clock, autostart=False)
        # A timer that is set from another thread does not wake the executor; a guard condition does.
        self._wake: Any = node.create_guard_condition(self._set, callback_group=group)

    def at(self, when_ns: int, job: Job) -> Alarm:
        """Have a job done at a moment; soon, when that has passed."""
        alarm = Alarm(job)
        with self._lock:
            heapq.heappush(self._waiting, (when_ns, next(self._numbers), alarm))
            first = self._waiting[0][2] is alarm
        if first and self._on_loop():
            self._set()
        elif first:
            self._wake.trigger()
        return alarm

    def after(self, delay_s: float, job: Job) -> Alarm:
        """Have a job done after a delay."""
        return self.at(int(self._clock.now().nanoseconds) + round(delay_s * 1e9), job)

    def _set(self) -> None:
        """Set the timer for the first job."""
        with self._lock:
            while self._waiting and not self._waiting[0][2].pending:
                heapq.heappop(self._waiting)
            due_ns = self._waiting[0][0] if self._waiting else None
        if due_ns is None:
            self._timer.cancel()
        else:
            self._timer.timer_period_ns = max(1, due_ns - int(self._clock.now().nanoseconds))
            self._timer.reset()

    def _ring(self) -> None:
        """Do what is due; what a job raises goes on to the executor, after the timer was set for the others."""
        self._timer.cancel()
        try:
            while (alarm := self._pop()) is not None:
                alarm.ring()
        finally:
            self._set()

    def _pop(self) -> Alarm | None:
        now_ns = int(self._clock.now().nanoseconds)
        with self._lock:
            return heapq.heappop(self._waiting)[2] if self._waiting and self._waiting[0][0] <= now_ns else None
