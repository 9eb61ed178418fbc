"""From the events of all skillsets to executions of skills and transitions of resources.

Each line of ``events.jsonl`` is a skillset_interfaces/Event. Stamps become seconds since lift-off only when they are shown:
here they are absolute seconds of mission clock.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from alula_flight.report.files import Problems, ReportError, finite, mapping

TERMINAL_STATES = frozenset({"NOT_VALIDATED", "NOT_READY", "RESOURCE_INVARIANT_VIOLATED", "INTERRUPTED", "TERMINATED", "FAILED"})
EXECUTION = "EXECUTION"
TRANSITION = "TRANSITION"
_KINDS = {0: EXECUTION, 1: TRANSITION, "0": EXECUTION, "1": TRANSITION, EXECUTION: EXECUTION, TRANSITION: TRANSITION}


@dataclass(frozen=True)
class ExecutionEvent:
    """An execution entered ``state``."""

    stamp_s: float
    sequence: int
    skillset: str
    skill: str
    id: str
    state: str
    result: str = ""
    message: str = ""
    inputs: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Transition:
    """A resource went from one state to another."""

    stamp_s: float
    sequence: int
    skillset: str
    resource: str
    source: str
    target: str
    cause: str


Event = ExecutionEvent | Transition


@dataclass(frozen=True)
class Execution:
    """A skill's execution from request to end; ``outcome`` is the last state seen, so RUNNING or REQUESTED if no end was."""

    skillset: str
    skill: str
    id: str
    inputs: dict[str, object]
    start_s: float
    running_s: float | None
    end_s: float | None
    outcome: str
    result: str
    message: str


@dataclass(frozen=True)
class History:
    """Everything that happened in the skillsets, in the order of time."""

    executions: tuple[Execution, ...] = ()
    transitions: tuple[Transition, ...] = ()
    first_s: float | None = None
    last_s: float | None = None

    def of_skill(self, skill: str) -> list[Execution]:
        """Return the executions of a skill, whatever skillset it belongs to."""
        return [execution for execution in self.executions if execution.skill == skill]


def parse_event(line: str) -> Event:
    """Read one line; raise ReportError when it is none of an event."""
    try:
        values = mapping(json.loads(line))
    except ValueError as error:
        raise ReportError(f"no JSON: {error}") from error
    stamp_s = finite(values.get("stamp_s"))
    if stamp_s is None:
        raise ReportError("no stamp_s")
    kind = _kind(values)
    number = finite(values.get("sequence"))
    common = (stamp_s, int(number) if number is not None else 0, _text(values, "skillset"))
    if kind == TRANSITION:
        states = (_text(values, "from_state", "from"), _text(values, "to_state", "to"))
        return Transition(*common, _text(values, "resource"), *states, _text(values, "cause"))
    state = _text(values, "state")
    if not state:
        raise ReportError("an execution without a state")
    names = (_text(values, "skill"), _text(values, "id"), state, _text(values, "result"), _text(values, "message"))
    return ExecutionEvent(*common, *names, _inputs(values))


def _kind(values: dict[str, object]) -> str:
    kind = values.get("kind")
    if isinstance(kind, str):
        kind = kind.upper()
    if isinstance(kind, str | int) and kind in _KINDS:
        return _KINDS[kind]
    return TRANSITION if values.get("resource") else EXECUTION


def _text(values: dict[str, object], *names: str) -> str:
    """Return the first of these values that is there, as text."""
    return next((str(values[name]) for name in names if values.get(name) is not None), "")


def _inputs(values: dict[str, object]) -> dict[str, object]:
    inputs = values.get("inputs", values.get("inputs_json"))
    if isinstance(inputs, str):
        try:
            inputs = json.loads(inputs) if inputs else {}
        except ValueError:
            return {"text": inputs}
    return mapping(inputs)


def read_events(path: Path, problems: Problems) -> list[Event]:
    """Read ``events.jsonl``; a missing file, bad lines and lost events are noted as problems."""
    if not path.exists():
        problems.note(f"{path.name} is missing: nothing is known of skills and resources")
        return []
    events: list[Event] = []
    lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            events.append(parse_event(line))
        except ReportError as error:
            # The writer ends each event with a newline: whatever stands behind the last one was cut off.
            what = "was cut off" if number == len(lines) else f"is no event ({error})"
            problems.note(f"{path.name}: line {number} {what}")
    ordered = in_order(events)
    for sentence in gaps(ordered):
        problems.note(f"{path.name}: {sentence}")
    return ordered


def in_order(events: Iterable[Event]) -> list[Event]:
    """Sort by time, the order of arrival deciding between equals, and drop repetitions (latched topics are sent again)."""
    seen: set[tuple[object, ...]] = set()
    unique: list[Event] = []
    for event in events:
        key = (event.skillset, event.sequence, event.stamp_s, *_what(event))
        if key not in seen:
            seen.add(key)
            unique.append(event)
    return sorted(unique, key=lambda event: event.stamp_s)


def _what(event: Event) -> tuple[str, ...]:
    if isinstance(event, Transition):
        return (TRANSITION, event.resource, event.source, event.target)
    return (EXECUTION, event.skill, event.id, event.state)


def gaps(events: Sequence[Event]) -> Iterator[str]:
    """Yield a sentence for each hole in a skillset's numbering, which begins at 1 and again at 1 with each restart."""
    last: dict[str, int] = {}
    for event in events:
        before = last.get(event.skillset, 0)
        last[event.skillset] = max(before, event.sequence) if event.sequence != 1 else 1
        if event.sequence > before + 1:
            yield f"{event.skillset} lost {event.sequence - before - 1} events before {event.stamp_s:.2f} s of mission clock"


def fold(events: Iterable[Event], problems: Problems) -> History:
    """Put the events of each execution together. The first terminal state counts; another one is noted as a problem."""
    executions: dict[tuple[str, str, str], Execution] = {}
    transitions: list[Transition] = []
    stamps: list[float] = []
    for event in events:
        stamps.append(event.stamp_s)
        if isinstance(event, Transition):
            transitions.append(event)
            continue
        key = (event.skillset, event.skill, event.id)
        before = executions.get(key)
        if before is not None and before.end_s is not None:
            problems.note(f"{event.skillset}.{event.skill} {event.id}: {event.state} after its end as {before.outcome}")
            continue
        executions[key] = _advance(before or _begin(event), event)
    return History(
        executions=tuple(executions.values()),
        transitions=tuple(transitions),
        first_s=min(stamps, default=None),
        last_s=max(stamps, default=None),
    )


def _begin(event: ExecutionEvent) -> Execution:
    return Execution(event.skillset, event.skill, event.id, event.inputs, event.stamp_s, None, None, event.state, "", "")


def _advance(execution: Execution, event: ExecutionEvent) -> Execution:
    return replace(
        execution,
        inputs=execution.inputs or event.inputs,
        running_s=event.stamp_s if event.state == "RUNNING" and execution.running_s is None else execution.running_s,
        end_s=event.stamp_s if event.state in TERMINAL_STATES else None,
        outcome=event.state,
        result=event.result or execution.result,
        message=event.message or execution.message,
    )
