"""Which nodes did not answer in time, and when they may be asked again: after pauses that grow."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

FIRST_PAUSE_S, LAST_PAUSE_S = 1.0, 60.0


@dataclass(frozen=True)
class _Hung:
    times: int
    until_s: float


class HungNodes:
    """The nodes that hang. Safe from several threads."""

    def __init__(self, clock_s: Callable[[], float]) -> None:
        """``clock_s`` is a steady clock."""
        self._clock_s = clock_s
        self._lock = threading.Lock()
        self._hung: dict[str, _Hung] = {}

    def may_be_asked(self, node: str) -> bool:
        """Return whether a node has answered the last time, or its pause is over."""
        with self._lock:
            return node not in self._hung or self._clock_s() >= self._hung[node].until_s

    def answers(self, node: str) -> None:
        """Take that a node has answered, whatever it said."""
        with self._lock:
            self._hung.pop(node, None)

    def hangs(self, node: str) -> None:
        """Take that a node has not answered in time."""
        with self._lock:
            times = self._hung[node].times if node in self._hung else 0
            pause_s = min(FIRST_PAUSE_S * 2.0**times, LAST_PAUSE_S)
            self._hung[node] = _Hung(min(times + 1, 10), self._clock_s() + pause_s)
