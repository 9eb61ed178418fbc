"""Calls an engine when something has become due: one timer on the node's clock, asleep while nothing is."""

from __future__ import annotations

from typing import Protocol

from rclpy.node import Node

SETTING = -1
"""No moment of any clock."""


class Due(Protocol):
    """Something that wants to be called at a moment of mission clock: an engine, a mock's agenda."""

    @property
    def due_ns(self) -> int | None:
        """When, or None: not by time alone."""
        ...

    def tick(self) -> None:
        """Do what has become due."""
        ...


class DueTimer:
    """Serves ``due_ns`` of an engine; ``look`` is to be called after every step that may have changed it."""

    def __init__(self, node: Node, engine: Due) -> None:
        self._engine = engine
        self._clock = node.get_clock()
        self._timer = node.create_timer(1.0, self._ring, autostart=False)
        # A timer that is set from another thread does not wake the executor; a guard condition does.
        self._wake = node.create_guard_condition(self._set)
        self._set_for_ns: int | None = None

    def look(self) -> None:
        """Have the timer set anew where it has to be, from any thread: to wake the executor costs it a turn."""
        if self._engine.due_ns != self._set_for_ns:
            self._wake.trigger()

    def _set(self) -> None:
        # Until the timer is set, whatever others see is not what it is set for: they have it set once more.
        self._set_for_ns = SETTING
        due_ns = self._engine.due_ns
        if due_ns is None:
            self._timer.cancel()
        else:
            self._timer.timer_period_ns = max(1, due_ns - self._clock.now().nanoseconds)
            self._timer.reset()
        self._set_for_ns = due_ns

    def _ring(self) -> None:
        self._set_for_ns = SETTING
        self._timer.cancel()
        self._engine.tick()
        self._set()
