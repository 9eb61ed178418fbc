"""Answers of services that come later, when a hook has spoken, while the executor goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from typing import Any, Generic, TypeVar

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

T = TypeVar("T")


class Deferral:
    """Lets a node's services await what other threads give; ``group`` is for these services.

    A group of their own, for an awaiting callback holds up everything else in its group; and a guard condition, for the executor
    (rclpy 7.1.6) resumes what awaits only after something has woken it.
    """

    def __init__(self, node: Node) -> None:
        self.group = ReentrantCallbackGroup()
        self._node = node
        self._wake: Any = node.create_guard_condition(_nothing, callback_group=self.group)

    async def within(self, start: Callable[[Callable[[T], None]], None], timeout_s: float, otherwise: T) -> T:
        """Return what ``start(give)`` has given, or ``otherwise`` after a time of wall clock: a hook that hangs hangs nobody else."""
        answer: _Answer[T] = _Answer(self._wake.trigger)
        end_s = time.monotonic() + timeout_s
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        timer = self._node.create_timer(timeout_s, _nothing, clock=clock, callback_group=self.group)
        try:
            start(answer.give)
            while not answer.given:
                if time.monotonic() > end_s:
                    return otherwise
                await _Turn()
            return answer.given[0]
        finally:
            self._node.destroy_timer(timer)


class _Answer(Generic[T]):
    def __init__(self, wake: Callable[[], None]) -> None:
        self.given: list[T] = []
        self._wake = wake
        self._lock = threading.Lock()

    def give(self, value: T) -> None:
        with self._lock:
            self.given.append(value)
        self._wake()


class _Turn:
    """Lets the executor do something else."""

    def __await__(self) -> Generator[None]:
        yield


def _nothing() -> None:
    """Wake the executor."""
