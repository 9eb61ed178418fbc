"""Jobs that wait for a moment: the timers of every middleware, and the queue that each of its clocks keeps them in."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable

Job = Callable[[], object]


class Timer:
    """A job that waits for its moment."""

    __slots__ = ("job", "when_ns")

    def __init__(self, when_ns: int, job: Job) -> None:
        self.when_ns = when_ns
        self.job: Job | None = job

    @property
    def pending(self) -> bool:
        """Return whether the job is still to come."""
        return self.job is not None

    def cancel(self) -> None:
        """Do not run the job; without effect when it has run."""
        self.job = None


FEW = 16


class TimerQueue:
    """Timers in the order of their moments; those of one moment in the order in which they were put in. Not safe for threads.

    Cancelled timers are taken out when they may be half of all: what is put in and cancelled again and again leaves nothing behind.
    """

    def __init__(self) -> None:
        self._timers: list[tuple[int, int, Timer]] = []
        self._numbers = itertools.count()
        self._look_at = FEW

    def put(self, when_ns: int, job: Job) -> Timer:
        """Have a job run at ``when_ns`` (mission clock); jobs of one moment run in the order in which they were put."""
        if len(self._timers) >= self._look_at:
            self._timers = [one for one in self._timers if one[2].pending]
            heapq.heapify(self._timers)
            self._look_at = FEW + 2 * len(self._timers)
        timer = Timer(when_ns, job)
        heapq.heappush(self._timers, (when_ns, next(self._numbers), timer))
        return timer

    def is_next(self, timer: Timer) -> bool:
        """Return whether no other timer's moment comes before this one's."""
        return bool(self._timers) and self._timers[0][2] is timer

    @property
    def due_ns(self) -> int | None:
        """The moment of the next job; None when there is none."""
        while self._timers and not self._timers[0][2].pending:
            heapq.heappop(self._timers)
        return self._timers[0][0] if self._timers else None

    def pop_due(self, now_ns: int) -> tuple[int, Job] | None:
        """Take the next job whose moment has come, and return its moment and the job; None when there is none."""
        timers = self._timers
        while timers and timers[0][0] <= now_ns:
            when_ns, _, timer = heapq.heappop(timers)
            job, timer.job = timer.job, None
            if job is not None:
                return when_ns, job
        return None
