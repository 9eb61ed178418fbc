"""Answers of services that come later, when a hook has spoken, while the executor goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator
from typing import Generic, TypeVar

T = TypeVar("T")
TURN_S = 0.002
"""rclpy resumes what awaits at every turn of the executor; this much of each turn is spent waiting, not burning."""


class Answer(Generic[T]):
    """A value that another thread gives, once."""

    def __init__(self) -> None:
        self._given = threading.Event()
        self._lock = threading.Lock()
        self._value: T | None = None

    def give(self, value: T) -> None:
        """Set the value, unless there is one."""
        with self._lock:
            if not self._given.is_set():
                self._value = value
                self._given.set()

    async def within(self, timeout_s: float, otherwise: T) -> T:
        """Return the value, or ``otherwise`` after a time of wall clock: a hook that hangs must not hang who asks."""
        end = time.monotonic() + timeout_s
        while not self._given.wait(TURN_S):
            if time.monotonic() > end:
                self.give(otherwise)
            await _Turn()
        return self._value  # type: ignore[return-value]  # it is given


class _Turn:
    """Lets the executor do something else."""

    def __await__(self) -> Generator[None]:
        yield
