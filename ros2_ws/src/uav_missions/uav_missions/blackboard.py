"""What the nodes of one tree share.

py_trees' own blackboard is one for the whole process, so two trees (or two tests) would write into each other's; this one is
typed, and each mission has its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from uav_missions.pending import PendingInterrupts
from uav_missions.route import Route
from uav_missions.skillset import Clock


@dataclass(frozen=True)
class Failure:
    """How a skill ended that should have succeeded; ``result`` names a result, a precondition or an invariant."""

    leaf: str
    skill: str
    outcome: str
    result: str
    message: str

    def sentence(self) -> str:
        """Return what a person wants to read."""
        what = self.result if self.outcome == "TERMINATED" else " ".join(filter(None, (self.outcome, self.result)))
        why = self.message.removeprefix(f"{self.result}: ") if self.result else self.message
        return f"{self.skill}: {what}" + (f" ({why})" if why else "")


@dataclass
class Blackboard:
    """The mission's memory; frames and units: map, metres, radians."""

    clock_ns: Clock
    route: Route
    pending: PendingInterrupts
    waypoint: tuple[float, float, float] | None = None
    aligned_yaw_rad: float | None = None
    failures: list[Failure] = field(default_factory=list)
    reason: str = ""

    @property
    def now_s(self) -> float:
        """Mission clock."""
        return self.clock_ns() / 1e9
