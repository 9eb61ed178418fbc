"""A list of subscribed callbacks that may change from any thread while it is called."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

CallbackT = TypeVar("CallbackT")
Unsubscribe = Callable[[], None]
"""Ends a subscription."""


class Callbacks(Generic[CallbackT]):
    """Callbacks in the order in which they came; iterating is over those that are there now, from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._callbacks: list[CallbackT] = []

    def add(self, callback: CallbackT) -> Unsubscribe:
        """Add a callback; the return value unsubscribes."""
        with self._lock:
            self._callbacks.append(callback)

        def unsubscribe() -> None:
            with self._lock:
                if callback in self._callbacks:
                    self._callbacks.remove(callback)

        return unsubscribe

    def __iter__(self) -> Iterator[CallbackT]:
        """Iterate over a copy: a callback may add others, and end any."""
        with self._lock:
            return iter(list(self._callbacks))
