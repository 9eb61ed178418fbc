"""Calls an engine's ``tick`` when something has become due, at the mission clock's time; nothing is polled."""

from __future__ import annotations

import threading

from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.middleware import Middleware
from alula.runtime.timers import Timer


class EngineTimer:
    """Serves ``due_ns`` of an engine; ``update`` is to be called after every step that may have changed it, from any thread."""

    def __init__(self, middleware: Middleware, engine: SkillsetEngine) -> None:
        self._middleware = middleware
        self._engine = engine
        self._lock = threading.Lock()
        self._set_for_ns: int | None = None
        self._timer: Timer | None = None

    def update(self) -> None:
        """Set the timer again where ``due_ns`` has changed."""
        with self._lock:
            # Asked with the lock held: of two threads that update at once, the later answer stands.
            due_ns = self._engine.due_ns
            if due_ns == self._set_for_ns:
                return
            if self._timer is not None:
                self._timer.cancel()
            self._set_for_ns = due_ns
            self._timer = None if due_ns is None else self._middleware.at(due_ns, self._expired)

    def _expired(self) -> None:
        with self._lock:
            self._set_for_ns, self._timer = None, None
        self._engine.tick()
        self.update()
