"""Calls an engine when something has become due, at the mission clock's time; nothing is polled."""

from __future__ import annotations

import threading

from skill_runtime.core.engine import SkillsetEngine
from skillset_ros1.alarms import Alarms


class DueAlarm:
    """Serves ``due_ns`` of an engine; ``look`` is to be called after every step that may have changed it."""

    def __init__(self, engine: SkillsetEngine, alarms: Alarms) -> None:
        self._engine = engine
        self._alarms = alarms
        self._lock = threading.Lock()
        self._set_for: int | None = None

    def look(self) -> None:
        """Have the alarm set anew, from any thread. An earlier one stays and finds nothing due."""
        due_ns = self._engine.due_ns
        with self._lock:
            if due_ns is None or due_ns == self._set_for:
                return
            self._set_for = due_ns
        self._alarms.at(due_ns, lambda: self._ring(due_ns))

    def _ring(self, due_ns: int) -> None:
        with self._lock:
            if self._set_for == due_ns:
                self._set_for = None
        self._engine.tick()
        self.look()
