"""A clock for limits on what is outside of simulated time: discovery, the bridge, a service's arrival."""

from __future__ import annotations

import threading
from collections.abc import Callable


class SlowerClock:
    """Passes as the slower one of two clocks does, from look to look; safe for threads.

    What runs out by it has lasted as long by both clocks: neither a simulation that runs ahead nor one that creeps or stands ends it early.
    Have it look at a pace that both clocks pass by, as the watch of a node does: between two steps of one of them nothing passes.

    Args:
        first_s: returns a clock's time, seconds, as the mission clock's.
        second_s: returns the other one's, as the monotonic clock's; either may jump, stand or begin anew.
    """

    def __init__(self, first_s: Callable[[], float], second_s: Callable[[], float]) -> None:
        self._clocks = (first_s, second_s)
        self._lock = threading.Lock()
        self._seen_s = (first_s(), second_s())
        self._now_s = 0.0

    @property
    def now_s(self) -> float:
        """Return its time at the last look, seconds; it begins at 0."""
        return self._now_s

    def look(self) -> float:
        """Add the smaller one of both clocks' steps since the last look; return its time, seconds."""
        with self._lock:
            seen_s = (self._clocks[0](), self._clocks[1]())
            self._now_s += max(0.0, min(seen_s[0] - self._seen_s[0], seen_s[1] - self._seen_s[1]))
            self._seen_s = seen_s
            return self._now_s
