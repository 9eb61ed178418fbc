"""Virtual time: a queue of jobs, each at its moment; time jumps from one to the next and never passes by itself."""

from __future__ import annotations

from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.timers import Job, Timer, TimerQueue

NANOSECONDS = 1_000_000_000
JOBS_AT_ONCE = 100_000
"""So many jobs at one moment can only be jobs that beget each other without end."""


class WorldError(SkillRuntimeError):
    """Virtual time can't be advanced as requested; the message has the reason."""


class VirtualClock:
    """Mission clock and event queue in one. Jobs of one moment are done in the order in which they were put in.

    Not safe for threads: one thread puts in jobs and lets time pass, so every run of the same jobs is the same run.
    """

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_ns = round(start_s * NANOSECONDS)
        self._timers = TimerQueue()
        self._at_once = 0

    @property
    def now_ns(self) -> int:
        """Mission clock, nanoseconds."""
        return self._now_ns

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        return self._now_ns / NANOSECONDS

    @property
    def idle(self) -> bool:
        """Return whether nothing is to come."""
        return self._timers.due_ns is None

    def at(self, when_ns: int, job: Job) -> Timer:
        """Run a job at a moment; at once, after what is due already, when the moment has passed."""
        return self._timers.put(max(when_ns, self._now_ns), job)

    def after(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay in seconds."""
        return self.at(self._now_ns + round(delay_s * NANOSECONDS), job)

    def soon(self, job: Job) -> Timer:
        """Run a job at this moment, after all that is due already."""
        return self.at(self._now_ns, job)

    def do_next(self, until_ns: int) -> bool:
        """Jump to the next job that is due by ``until_ns`` and do it; where there is none, jump to ``until_ns`` and return False.

        Raises:
            WorldError: jobs beget jobs without end, and time stands still.
        """
        due = self._timers.pop_due(until_ns)
        if due is None:
            self._now_ns = max(self._now_ns, until_ns)
            return False
        when_ns, job = due
        self._at_once = self._at_once + 1 if when_ns == self._now_ns else 0
        if self._at_once > JOBS_AT_ONCE:
            raise WorldError(f"time stands still at {self.now_s:g} s: more than {JOBS_AT_ONCE} jobs at one moment")
        self._now_ns = when_ns
        job()
        return True
