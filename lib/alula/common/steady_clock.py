"""The mission clock where nothing publishes ``/clock``: the wall clock without its steps.

NTP may set the wall clock by an hour in the middle of a mission. Whatever lasts is therefore measured by the monotonic clock; only the
stamps of messages, which other computers read, are wall time. The two are converted where a message is sent or received.
"""

from __future__ import annotations

import time
from collections.abc import Callable

STEP_NS = 10_000_000
"""What NTP slews is followed by so much at a time; until then the stamps of a process that was not set are the mission clock itself."""
LOOKS, CLOSE_NS = 5, 100_000
"""How often both clocks are read for one pair, and how far apart the readings of a good pair are."""


class SteadyClock:
    """The wall clock as it was when this was made, carried on by the monotonic clock; safe for threads.

    Args:
        wall_ns: the wall clock, nanoseconds since 1970; it may be set at any time.
        steady_ns: a clock that nobody sets, nanoseconds.
    """

    def __init__(
        self,
        wall_ns: Callable[[], int] = time.time_ns,  # noqa: TID251 - this is what takes its steps out
        steady_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._wall_ns = wall_ns
        self._steady_ns = steady_ns
        self._ahead_ns = self._measure()
        self._set_ns = 0

    def now_ns(self) -> int:
        """Return the mission clock, nanoseconds."""
        return self._steady_ns() + self._ahead_ns

    def steady_ns(self, moment_ns: int) -> int:
        """Return a moment of the mission clock as the monotonic clock has it."""
        return moment_ns - self._ahead_ns

    @property
    def set_ns(self) -> int:
        """By how much the wall clock was set forward since this was made, nanoseconds."""
        if abs(self._wall_ns() - self.now_ns() - self._set_ns) > STEP_NS:
            # Perhaps this thread was only interrupted between the two readings.
            set_ns = self._measure() - self._ahead_ns
            if abs(set_ns - self._set_ns) > STEP_NS:
                self._set_ns = set_ns
        return self._set_ns

    def stamp_ns(self, moment_ns: int) -> int:
        """Return the wall time, as that is set now, of a moment of the mission clock: the stamp of a message."""
        return moment_ns + self.set_ns

    def moment_ns(self, stamp_ns: int) -> int:
        """Return the moment of the mission clock that a message's stamp tells, in wall time as that is set now; 0, no time, stays 0."""
        return stamp_ns and stamp_ns - self.set_ns

    def _measure(self) -> int:
        """Return how far the wall clock is ahead of the monotonic one, by the best of a few readings."""
        best: tuple[int, int] | None = None
        for _ in range(LOOKS):
            before_ns, wall_ns, after_ns = self._steady_ns(), self._wall_ns(), self._steady_ns()
            pair = (after_ns - before_ns, wall_ns - (before_ns + after_ns) // 2)
            best = pair if best is None else min(best, pair)
            if best[0] <= CLOSE_NS:
                break
        return best[1] if best else 0


STEADY_CLOCK = SteadyClock()
"""The one of this process: managers, clients, missions and hooks in it share their moments."""
