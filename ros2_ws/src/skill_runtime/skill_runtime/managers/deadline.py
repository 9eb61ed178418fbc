"""Calls an engine when something has become due, at the mission clock's time; nothing is polled."""

from __future__ import annotations

import threading
from typing import Protocol

from skill_runtime.middleware import Middleware, Timer


class Due(Protocol):
    """Something that wants to be called at a moment of mission clock."""

    @property
    def due_ns(self) -> int | None:
        """When, or None: not by time alone."""
        ...

    def tick(self) -> None:
        """Do what has become due."""
        ...


class EngineAlarm:
    """Serves ``due_ns`` of an engine; ``look`` is to be called after every step that may have changed it, from any thread."""

    def __init__(self, middleware: Middleware, engine: Due) -> None:
        self._middleware = middleware
        self._engine = engine
        self._lock = threading.Lock()
        self._set_for_ns: int | None = None
        self._timer: Timer | None = None

    def look(self) -> None:
        """Have the alarm set again where that has changed."""
        with self._lock:
            # Asked with the lock held: two threads that look at once leave the later answer standing.
            due_ns = self._engine.due_ns
            if due_ns == self._set_for_ns:
                return
            if self._timer is not None:
                self._timer.cancel()
            self._set_for_ns = due_ns
            self._timer = None if due_ns is None else self._middleware.at(due_ns, self._ring)

    def _ring(self) -> None:
        with self._lock:
            self._set_for_ns, self._timer = None, None
        self._engine.tick()
        self.look()
