"""Delivers events in order, never with a lock held."""

from __future__ import annotations

import threading
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

from alula.runtime.core.events import EngineEvent, ExecutionEvent, Listener
from alula.runtime.core.sanitize import as_text, error_line


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
        """Give queued events to the listener; if another thread does that already, it also delivers this thread's events."""
        while True:
            with self._lock:
                if self._delivering or not self._steps:
                    return
                self._delivering = True
                events = self._steps.popleft()
            try:
                self._tell(events)
            finally:
                with self._lock:
                    self._delivering = False

    def _tell(self, events: tuple[EngineEvent, ...]) -> None:
        """Give a step to the listener; if that raises, again without inputs and outputs, so that no caller misses an end."""
        try:
            self._listener(events)
        except Exception as error:  # noqa: BLE001 - a listener must not stop the managers
            self._on_error(as_text(f"the listener raised {''.join(traceback.format_exception(error))}"))
            without = tuple(_without_values(event, error) for event in events)
        else:
            return
        try:
            self._listener(without)
        except Exception as error:  # noqa: BLE001 - as above
            self._on_error(as_text(f"the listener raised again {''.join(traceback.format_exception(error))}"))


def _without_values(event: EngineEvent, error: Exception) -> EngineEvent:
    """Return an event without the values of hooks and callers; its message says why they are missing."""
    if not isinstance(event, ExecutionEvent):
        return event
    reason = f"inputs and outputs could not be published: {error_line(error)}"
    message = f"{event.message} ({reason})" if event.message else reason
    return replace(event, message=as_text(message), inputs={}, outputs={})
