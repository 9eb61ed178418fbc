"""The context of one mission: what its nodes share besides the entries of their blackboard.

py_trees' own blackboard is one for the whole process, so two trees (or two tests) would write into each other's; this one is
typed, and each mission has its own: derive from it to add what the leaves of a mission share.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from alula.missions.pending import PendingInterrupts
from alula.missions.skillset import NANOSECONDS, Clock
from alula.model.execution_state import ExecutionState


@dataclass(frozen=True)
class Failure:
    """How a skill ended that should have succeeded; ``result`` names a result, a precondition or an invariant."""

    leaf: str
    skill: str
    state: ExecutionState
    result: str
    message: str

    def sentence(self) -> str:
        """Return what a person wants to read."""
        ended = self.state is ExecutionState.TERMINATED
        what = self.result if ended else f"{self.state.value} {self.result}".strip()
        why = self.message.removeprefix(f"{self.result}: ") if self.result else self.message
        return f"{self.skill}: {what}" + (f" ({why})" if why else "")


@dataclass(kw_only=True)
class MissionContext:
    """The context of a mission: its clock, what failed, and why; a robot's own derives from it."""

    clock_ns: Clock
    pending: PendingInterrupts
    failures: list[Failure] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    """What went wrong besides, as the tree has noted it."""
    reason: str = ""
    entries: Callable[[], Mapping[str, object]] = dict
    """What is on the blackboard of a mission that is a file, by name."""

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        return self.clock_ns() / NANOSECONDS

    def values(self) -> Mapping[str, object]:
        """Return what is on it by name, as ``json`` can write it; what derives from this adds its own."""
        return {"failures": [failure.sentence() for failure in self.failures], "reason": self.reason, **self.entries()}

    def note_reason(self) -> None:
        """Keep what went wrong up to here as the mission's reason; what fails afterwards, while stopping, is not the reason."""
        self.reason = self.what_went_wrong

    def note(self, what: str) -> None:
        """Keep a reason for failure that no skill reports, once."""
        if what not in self.notes:
            self.notes.append(what)

    @property
    def what_went_wrong(self) -> str:
        """What failed up to now, and what was noted, in words."""
        return "; then ".join(dict.fromkeys([*(failure.sentence() for failure in self.failures), *self.notes]))
