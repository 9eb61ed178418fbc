"""Delivers events in order, never with a lock held."""

from __future__ import annotations

import threading
import traceback
from collections import deque
from collections.abc import Callable, Sequence

from skill_runtime.core.events import EngineEvent, Listener


class Outbox:
    """Events of steps on their way to the listener, one step at a time; ``on_error`` gets what the listener raises."""

    def __init__(self, listener: Listener, on_error: Callable[[str], None]) -> None:
        self._listener = listener
        self._on_error = on_error
        self._lock = threading.Lock()
        self._steps: deque[tuple[EngineEvent, ...]] = deque()
        self._delivering = False

    def put(self, events: Sequence[EngineEvent]) -> None:
        """Queue the events of one step; callers see to the order."""
        if events:
            with self._lock:
                self._steps.append(tuple(events))

    def deliver(self) -> None:
        """Give queued events to the listener; a thread that finds another at it leaves its events to that one."""
        while True:
            with self._lock:
                if self._delivering or not self._steps:
                    return
                self._delivering = True
                events = self._steps.popleft()
            try:
                self._listener(events)
            except Exception as error:  # noqa: BLE001 - a listener must not stop the managers
                self._on_error(f"the listener raised {''.join(traceback.format_exception(error))}")
            finally:
                with self._lock:
                    self._delivering = False
