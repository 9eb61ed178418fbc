"""From the events of all skillsets to executions of skills and transitions of resources.

Each message on ``/events`` of ``skills.mcap`` is the record of an event (see ``alula.runtime.core.events``). Stamps become seconds
since lift-off only when they are shown: here they are absolute seconds of mission clock.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from alula.common.record import EVENTS, Entry, RecordFollower
from alula.common.run_log import account
from alula.records.causes.failures import SkillFailure, skill_failures
from alula.records.causes.told_ends import with_told_ends
from alula.records.tree import Places, places_in
from alula.report.files import Problems, mapping
from alula.runtime.core.events import EngineEvent, TransitionEvent, read_event
from alula.runtime.core.records import ExecutionRecord


@dataclass(frozen=True)
class History:
    """Everything that happened in the skillsets, in the order of time."""

    executions: tuple[ExecutionRecord, ...] = ()
    transitions: tuple[TransitionEvent, ...] = ()
    events: tuple[EngineEvent, ...] = ()
    places: Places = field(default_factory=Places)
    """Where in the tree each execution was started."""
    first_s: float | None = None
    last_s: float | None = None
    mission: Mapping[str, Any] = field(default_factory=dict)
    """What the mission was to do and how it ended; empty where that is not known."""

    @cached_property
    def failures(self) -> tuple[SkillFailure, ...]:
        """The executions that ended badly, in the order of the events."""
        return tuple(skill_failures(self.events))

    def of_skill(self, skill: str) -> list[ExecutionRecord]:
        """Return the executions of a skill, whatever skillset it belongs to."""
        return [execution for execution in self.executions if execution.skill == skill]


def read_history(path: Path, problems: Problems) -> History:
    """Read ``skills.mcap``; a missing file, a missing end, what is no event and lost events are noted as problems.

    Raises:
        RecordError: the file is no record.
    """
    if not path.exists():
        problems.note(f"{path.name} is missing: nothing is known of skills and resources")
        return History(mission=account(path.parent, []))
    record = RecordFollower(path)
    entries = record.poll()
    events = read_events(path, entries, problems)
    if record.cut:
        problems.note(f"{path.name}: {record.cut}")
    mission = account(path.parent, entries)
    for sentence in gaps(events, mapping(mission.get("joined", {}))):
        problems.note(f"{path.name}: {sentence}")
    return replace(fold(with_told_ends(events, entries), problems, places_in(entries)), mission=mission)


def read_events(path: Path, entries: Iterable[Entry], problems: Problems) -> list[EngineEvent]:
    """Return the events of a record in the order of time; what is no event is noted as a problem."""
    events: list[EngineEvent] = []
    for number, entry in enumerate((entry for entry in entries if entry.topic == EVENTS), start=1):
        try:
            events.append(read_event(entry.value))
        except ValueError as error:
            problems.note(f"{path.name}: event {number} is no event ({error})")
    return in_order(events)


def in_order(events: Iterable[EngineEvent]) -> list[EngineEvent]:
    """Sort by time, the order of arrival deciding between equals, and drop repetitions (latched topics are sent again)."""
    seen: set[tuple[object, ...]] = set()
    unique: list[EngineEvent] = []
    for event in events:
        key = (event.skillset, event.instance_id, event.sequence, event.stamp_s, *_what(event))
        if key not in seen:
            seen.add(key)
            unique.append(event)
    return sorted(unique, key=lambda event: event.stamp_s)


def _what(event: EngineEvent) -> tuple[str, ...]:
    if isinstance(event, TransitionEvent):
        return ("", event.resource, event.from_state, event.to_state)
    return (event.skill, event.id, event.state.value)


def gaps(events: Sequence[EngineEvent], joined: Mapping[str, object] | None = None) -> Iterator[str]:
    """Yield a sentence for each hole in a skillset's numbering, which begins at 1 with each start of its managers.

    ``joined``: the number of a skillset's last event before the mission, where its managers ran already.
    """
    last = {skillset: number for skillset, number in (joined or {}).items() if isinstance(number, int)}
    managers: dict[str, str] = {}
    for event in events:
        others = event.instance_id != managers.setdefault(event.skillset, event.instance_id)
        managers[event.skillset] = event.instance_id
        before = 0 if others or event.sequence == 1 else last.get(event.skillset, 0)
        last[event.skillset] = max(before, event.sequence)
        if event.sequence > before + 1:
            yield f"{event.skillset} lost {event.sequence - before - 1} events before {event.stamp_s:.2f} s of mission clock"


def fold(events: Sequence[EngineEvent], problems: Problems, places: Places | None = None) -> History:
    """Put the events of each execution together. The first terminal state counts; another one is noted as a problem."""
    executions: dict[tuple[str, str, str], ExecutionRecord] = {}
    transitions: list[TransitionEvent] = []
    stamps: list[float] = []
    for event in events:
        stamps.append(event.stamp_s)
        if isinstance(event, TransitionEvent):
            transitions.append(event)
            continue
        key = (event.skillset, event.skill, event.id)
        before = executions.get(key)
        if before is not None and before.state.terminal:
            problems.note(f"{event.skillset}.{event.skill} {event.id}: {event.state.value} after its end as {before.state.value}")
            continue
        executions[key] = before.then(event) if before else ExecutionRecord.begun(event)
    return History(
        executions=tuple(executions.values()),
        transitions=tuple(transitions),
        events=tuple(events),
        places=places or Places(),
        first_s=min(stamps, default=None),
        last_s=max(stamps, default=None),
    )
