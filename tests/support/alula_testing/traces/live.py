"""What both stages on real graphs share: threads, wall clock, and events that come as messages."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from alula.runtime.codecs import event_of, stamp_ns_of
from alula.runtime.core.events import event_record
from alula_testing import waits

TIMEOUT_S = 90.0


def after(delay_s: float, job: Callable[[], object]) -> threading.Timer:
    """Run a job on a thread after a delay."""
    timer = threading.Timer(delay_s, job)
    timer.daemon = True
    timer.start()
    return timer


def until(condition: Callable[[], bool], what: str) -> None:
    """Wait until the condition holds."""
    waits.until(condition, what, TIMEOUT_S)


class LiveStage:
    """What the stages of both worlds do alike."""

    def __init__(self) -> None:
        self.listener = Listener()

    def last(self, client: Any, skill: str) -> tuple[str, str, str, str] | None:
        """Ask a ``SkillsetClient`` of either world."""
        last = client.last(skill)
        return None if last is None else (last.id, last.outcome, last.result, last.message)

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait."""
        until(condition, what)

    def events(self) -> list[dict[str, Any]]:
        """Return what was heard."""
        return self.listener.events()


class Listener:
    """Hears events; those that come twice, once."""

    def __init__(self) -> None:
        self._heard: dict[int, dict[str, Any]] = {}
        self._lock = threading.Lock()

    def hear(self, event: Any) -> None:
        """Take an ``Event`` of either world."""
        with self._lock:
            self._heard[event.sequence] = event_record(event_of(event, stamp_ns_of(event.header.stamp)))

    def events(self) -> list[dict[str, Any]]:
        """Return all, in order; none while one is missing in between."""
        with self._lock:
            numbers = sorted(self._heard)
            return [self._heard[number] for number in numbers] if numbers == list(range(1, len(numbers) + 1)) else []
