"""Check the events of one skillset against its model, one after another, up to the first that the semantics does not allow.

A log does not say where a step begins, nor what data and time have decided. So the monitor keeps every belief that explains the log
so far, most of the time one; an event that no belief allows is a finding.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from alula.model import semantics
from alula.model.model import Skillset
from alula.records.conformance.beliefs import Belief, after_happening, agrees, event_told, told
from alula.records.conformance.explain import allowed, refusal
from alula.records.conformance.possible import LoggedSteps
from alula.runtime.core.events import EngineEvent, ExecutionEvent


@dataclass(frozen=True)
class Finding:
    """The first event of a skillset that does not conform; ``allowed`` lists the events that would have."""

    skillset: str
    sequence: int
    stamp_s: float
    event: str
    why: str
    allowed: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.skillset} event {self.sequence} at {self.stamp_s:.3f} s: {self.event}: {self.why}"

    def as_dict(self) -> dict[str, object]:
        """Return the finding as ``conform --json`` prints it."""
        return {**vars(self), "allowed": list(self.allowed)}


class SkillsetMonitor:
    """Follows one skillset. ``finding`` is the first event that does not conform; later ones are not looked at.

    Args:
        skillset: the model.
        assumed: states of resources at the beginning, instead of their initial ones.

    Raises:
        UnsupportedModelError: the model can't be executed.
    """

    def __init__(self, skillset: Skillset, assumed: Mapping[str, str] = MappingProxyType({})) -> None:
        self.skillset = skillset
        self.assumed = assumed
        self.finding: Finding | None = None
        self.restarts: list[float] = []
        """When the managers were restarted, seconds of mission clock."""
        self.events = 0
        self._steps = LoggedSteps(skillset)
        self._begin()

    def _begin(self) -> None:
        first = semantics.initial(self.skillset)
        self._beliefs: list[Belief] = [Belief(replace(first, states={**first.states, **self.assumed}))]
        self._last: EngineEvent | None = None
        self._ended: dict[str, str] = {}

    def take(self, event: EngineEvent) -> Finding | None:
        """Take the next event. Return a finding, the first time."""
        if self.finding is not None:
            return None
        self.events += 1
        if self._restarted(event):
            self.restarts.append(event.stamp_s)
            self._begin()
        why = self._out_of_order(event)
        if not why:
            following = list(self._following(event))
            if following:
                self._beliefs = _distinct(following)
                self._remember(event)
                return None
            why = refusal(self._steps, self._beliefs, self._ended, event)
        self.finding = Finding(
            self.skillset.name, event.sequence, event.stamp_s, event_told(event), why, allowed(self._steps, self._beliefs)
        )
        return self.finding

    @property
    def belief(self) -> Belief:
        """Return the first of the beliefs that explain the log so far."""
        return self._beliefs[0]

    @property
    def open(self) -> tuple[str, ...]:
        """Return the executions that have not ended, as skill and id."""
        return tuple(f"{execution.skill} {execution.id}" for execution in self._beliefs[0].open)

    @property
    def owed(self) -> tuple[str, ...]:
        """Return the events still missing of the step under way, by the first belief; none where some belief misses nothing."""
        if any(not belief.expected for belief in self._beliefs):
            return ()
        return tuple(told(happening) for happening in self._beliefs[0].expected)

    def _restarted(self, event: EngineEvent) -> bool:
        """Return whether managers were restarted before an event; in older logs: it is number 1 again, and time has passed."""
        if self._last is None:
            return False
        if event.instance_id and self._last.instance_id:
            return event.instance_id != self._last.instance_id
        return event.sequence == 1 and event.stamp_ns > self._last.stamp_ns

    def _out_of_order(self, event: EngineEvent) -> str:
        before = 0 if self._last is None else self._last.sequence
        if event.sequence <= before:
            return f"it comes after event {before}: the log is out of order, or has an event twice"
        if event.sequence > before + 1:
            missing = f"event {before + 1} is" if event.sequence == before + 2 else f"events {before + 1} to {event.sequence - 1} are"
            return f"{missing} missing"
        if self._last is not None and event.stamp_ns < self._last.stamp_ns:
            return f"it is older than the event before, which is of {self._last.stamp_s:.3f} s"
        return ""

    def _following(self, event: EngineEvent) -> Iterator[Belief]:
        """Yield the beliefs after an event."""
        for belief in self._beliefs:
            for begun in [belief] if belief.expected else self._begun(belief, event):
                if agrees(event, begun.expected[0]):
                    moved = replace(begun, expected=begun.expected[1:], open=after_happening(begun.open, begun.expected[0]))
                    yield moved if moved.expected else replace(moved, since_ns=self._steps.watched(moved))

    def _begun(self, belief: Belief, event: EngineEvent) -> Iterator[Belief]:
        """Yield the beliefs at the beginning of a step that an event may be the first of.

        A stamp is read after the step was taken, but before the next one is: the step is not older than the event before it.
        """
        earliest_ns = 0 if self._last is None else self._last.stamp_ns
        now = replace(belief, situation=replace(belief.situation, now_ns=event.stamp_ns), earliest_ns=earliest_ns)
        for step in self._steps.of(now, event):
            if step.happenings:
                yield replace(now, situation=step.situation, expected=step.happenings, stimulus=step.stimulus)

    def _remember(self, event: EngineEvent) -> None:
        self._last = event
        if isinstance(event, ExecutionEvent) and event.state.terminal:
            self._ended[event.id] = event.state.value


def _distinct(beliefs: Sequence[Belief]) -> list[Belief]:
    """Return the beliefs that expect something else of what is to come; how they came about does not matter."""
    found: list[Belief] = []
    for belief in beliefs:
        if not any(belief.same_future(other) for other in found):
            found.append(belief)
    return found
