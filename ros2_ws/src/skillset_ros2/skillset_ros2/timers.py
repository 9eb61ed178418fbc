"""Jobs at moments of a clock of rclpy, done on the executor of a node: one timer, asleep while nothing is due."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock
from rclpy.node import Node

from alula.runtime.timers import Job, Timer, TimerQueue
from skillset_ros2.mission_clock import STEADY, NodeClock

NEVER_NS = 10**18
"""Thirty years. rcl wakes the executor at each tick of a simulated clock behind a timer's moment, also when the timer is cancelled."""


class RclpyTimers:
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
        self._queue = TimerQueue()
        self._timer: Any = node.create_timer(NEVER_NS / 1e9, self._ring, callback_group=group, clock=clock, autostart=False)
        # A timer that is set from another thread does not wake the executor; a guard condition does.
        self._wake: Any = node.create_guard_condition(self._set, callback_group=group)

    def at(self, when_ns: int, job: Job) -> Timer:
        """Run a job at a moment; soon, when that has passed."""
        with self._lock:
            timer = self._queue.put(when_ns, job)
            first = self._queue.is_next(timer)
        if first and self._on_loop():
            self._set()
        elif first:
            self._wake.trigger()
        return timer

    def after(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay."""
        return self.at(int(self._clock.now().nanoseconds) + round(delay_s * 1e9), job)

    def _set(self) -> None:
        """Set the timer for the first job."""
        with self._lock:
            due_ns = self._queue.due_ns
        self._timer.timer_period_ns = NEVER_NS if due_ns is None else max(0, due_ns - int(self._clock.now().nanoseconds))
        self._timer.reset()
        if due_ns is None:
            self._timer.cancel()

    def _ring(self) -> None:
        """Do what is due; what a job raises goes on to the executor, after the timer was set for the others."""
        self._timer.cancel()
        try:
            while (job := self._pop()) is not None:
                job()
        finally:
            self._set()

    def _pop(self) -> Job | None:
        with self._lock:
            due = self._queue.pop_due(int(self._clock.now().nanoseconds))
        return None if due is None else due[1]


class MissionTimers:
    """Jobs at moments of a node's mission clock, and after delays of wall clock.

    Args:
        node: whose executor does them.
        clock: its mission clock.
        group: of the callbacks.
        on_loop: as of ``RclpyTimers``.
    """

    def __init__(self, node: Node, clock: NodeClock, group: CallbackGroup, on_loop: Callable[[], bool]) -> None:
        self._clock = clock
        self._simulated = RclpyTimers(node, node.get_clock(), group, on_loop)
        self._steady = RclpyTimers(node, STEADY, group, on_loop)

    def at(self, when_ns: int, job: Job) -> Timer:
        """Run a job at a moment of the mission clock; soon, when that has passed."""
        return self._simulated.at(when_ns, job) if self._clock.simulated else self._steady.at(self._clock.steady_ns(when_ns), job)

    def later(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay of wall clock."""
        return self._steady.after(delay_s, job)
