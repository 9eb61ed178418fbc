"""Executions that the tree has interrupted and that have not ended yet.

A leaf that starts while another one's interruption is under way would be NOT_READY: the resource is still taken. Trying again
blindly would hide real refusals, so a start waits here, and only for interruptions in the same skillset (no resource is
shared between two), unless the mission wants all of them to wait.
The wait is bounded; after it the start is made anyway, and the resource manager has the last word.
"""

from __future__ import annotations

from dataclasses import dataclass

from alula.missions.skillset import NANOSECONDS, Clock
from alula.runtime.handle import SkillHandle


@dataclass(frozen=True)
class _Pending:
    skillset: str
    skill: str
    handle: SkillHandle
    since_ns: int
    holds_all: bool


class PendingInterrupts:
    """The registry; ``bound_s`` of mission clock is how long a start waits for one interruption at most."""

    def __init__(self, clock_ns: Clock, bound_s: float = 5.0) -> None:
        self._clock_ns = clock_ns
        self._bound_ns = bound_s * NANOSECONDS
        self._pending: list[_Pending] = []

    def interrupt(self, skillset: str, skill: str, handle: SkillHandle, *, holds_all: bool = False) -> None:
        """Ask for the end of an execution and remember it until it has ended; ``holds_all``: starts in all skillsets wait for it."""
        handle.interrupt()
        self._pending.append(_Pending(skillset, skill, handle, self._clock_ns(), holds_all))

    def names(self, skillset: str | None = None) -> list[str]:
        """Return the skills whose end a start in this skillset (None: in any) waits for: their interruption is under way, not overdue."""
        now_ns = self._clock_ns()
        self._pending = [p for p in self._pending if not p.handle.done and now_ns - p.since_ns < self._bound_ns]
        return [f"{p.skillset}.{p.skill}" for p in self._pending if p.holds_all or skillset in {None, p.skillset}]
