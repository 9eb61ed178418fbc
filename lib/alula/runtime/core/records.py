"""What has happened: the state of each resource and its last transitions, the executions of each skill."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from alula.common.public import public
from alula.model.execution_state import ExecutionState
from alula.model.model import ResultKind, Skillset
from alula.runtime.core.events import NANOSECONDS, EngineEvent, ExecutionEvent, TransitionEvent

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


@public("alula.parts")
@dataclass(frozen=True)
class ExecutionRecord:
    """One execution, open or ended, by its events. Stamps are mission clock; None: that has not happened.

    ``result_kind`` is as in ``ExecutionEvent``.
    """

    id: str
    skill: str
    state: ExecutionState
    result: str
    message: str
    inputs: Any
    outputs: Mapping[str, object]
    requested_ns: int
    started_ns: int | None = None
    ended_ns: int | None = None
    skillset: str = ""
    result_kind: ResultKind | None = None

    @property
    def requested_s(self) -> float:
        """When it was asked for, in seconds."""
        return self.requested_ns / NANOSECONDS

    @property
    def started_s(self) -> float | None:
        """When it was RUNNING for the first time, in seconds."""
        return None if self.started_ns is None else self.started_ns / NANOSECONDS

    @property
    def ended_s(self) -> float | None:
        """When it came to its terminal state, in seconds."""
        return None if self.ended_ns is None else self.ended_ns / NANOSECONDS

    @classmethod
    def begun(cls, event: ExecutionEvent) -> ExecutionRecord:
        """Return the record of an execution whose first event this is."""
        return cls(event.id, event.skill, event.state, "", "", event.inputs, {}, event.stamp_ns, skillset=event.skillset).then(event)

    def then(self, event: ExecutionEvent) -> ExecutionRecord:
        """Return the record after one more event."""
        starts = event.state is ExecutionState.RUNNING and self.started_ns is None
        return replace(
            self,
            state=event.state,
            result=event.result,
            result_kind=event.result_kind,
            message=event.message,
            outputs=event.outputs,
            started_ns=event.stamp_ns if starts else self.started_ns,
            ended_ns=event.stamp_ns if event.state.terminal else None,
        )


def executions_of(events: Iterable[EngineEvent]) -> list[ExecutionRecord]:
    """Return the executions that events tell of, by age."""
    found: dict[tuple[str, str, str], ExecutionRecord] = {}
    for event in events:
        if isinstance(event, ExecutionEvent):
            key = (event.skillset, event.skill, event.id)
            found[key] = found[key].then(event) if key in found else ExecutionRecord.begun(event)
    return list(found.values())


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
    record = known[event.id].then(event) if event.id in known else ExecutionRecord.begun(event)
    if not event.state.terminal:
        return replace(skill, open=tuple((known | {event.id: record}).values()))
    known.pop(event.id, None)
    return SkillRecord(tuple(known.values()), record)
