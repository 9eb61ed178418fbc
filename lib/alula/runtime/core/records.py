"""What has happened: the state of each resource and its last transitions, the executions of each skill."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent

HISTORY = 20
"""Transitions that are kept of each resource."""


@dataclass(frozen=True)
class ResourceStatus:
    """A resource at one moment; before its first transition ``previous`` is empty and ``stamp_ns`` that of the engine's start.

    ``reason``: why it is in its state, as the functional layer has told; empty where it told nothing.
    """

    state: str
    previous: str
    stamp_ns: int
    reason: str = ""


@dataclass(frozen=True)
class ExecutionRecord:
    """One execution, open or ended. Stamps are mission clock, nanoseconds; 0: that has not happened."""

    id: str
    skill: str
    state: ExecutionState
    result: str
    message: str
    inputs: object
    outputs: Mapping[str, object]
    requested_ns: int
    started_ns: int = 0
    ended_ns: int = 0


@dataclass(frozen=True)
class SkillRecord:
    """What is known of one skill: the executions that have not ended, by age, and the one that ended last."""

    open: tuple[ExecutionRecord, ...] = ()
    last: ExecutionRecord | None = None


class Records:
    """Follows the events of one skillset. Not safe for threads."""

    def __init__(self, skillset: Skillset) -> None:
        self.skills = {skill.name: SkillRecord() for skill in skillset.skills}
        self._history: dict[str, deque[TransitionEvent]] = {r.name: deque(maxlen=HISTORY) for r in skillset.resources}

    def on_events(self, events: Sequence[EngineEvent]) -> None:
        """Take the events of one step."""
        for event in events:
            if isinstance(event, TransitionEvent):
                self._history[event.resource].append(event)
            else:
                self.skills[event.skill] = _followed(self.skills[event.skill], event)

    def history(self, resources: Iterable[str]) -> tuple[TransitionEvent, ...]:
        """Return the last transitions of these resources, the oldest first."""
        return tuple(sorted((event for name in resources for event in self._history[name]), key=lambda event: event.sequence))


def _followed(skill: SkillRecord, event: ExecutionEvent) -> SkillRecord:
    known = {record.id: record for record in skill.open}
    stamp_ns = event.stamp_ns
    record = known.get(event.id) or ExecutionRecord(event.id, event.skill, event.state, "", "", event.inputs, {}, stamp_ns)
    record = replace(record, state=event.state, result=event.result, message=event.message, outputs=event.outputs)
    if event.state is ExecutionState.RUNNING and not record.started_ns:
        record = replace(record, started_ns=stamp_ns)
    if not event.state.terminal:
        return replace(skill, open=tuple((known | {event.id: record}).values()))
    known.pop(event.id, None)
    return SkillRecord(tuple(known.values()), replace(record, ended_ns=stamp_ns))
