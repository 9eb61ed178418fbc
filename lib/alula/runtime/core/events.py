"""What an engine tells its listener, and how it is written down: one record for files, reports and all listeners."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from alula.model.execution_state import ExecutionState
from alula.runtime.plain import to_plain

NANOSECONDS = 1e9
EXECUTION = "EXECUTION"
TRANSITION = "TRANSITION"


@dataclass(frozen=True)
class ExecutionEvent:
    """An execution entered ``state``; ``result`` is as in ``Execution``. ``stamp_ns`` is mission clock."""

    sequence: int
    stamp_ns: int
    skill: str
    id: str
    state: ExecutionState
    result: str
    message: str
    inputs: object
    outputs: Mapping[str, object]
    skillset: str = ""

    @property
    def stamp_s(self) -> float:
        """Seconds of mission clock."""
        return self.stamp_ns / NANOSECONDS


@dataclass(frozen=True)
class TransitionEvent:
    """A resource changed; ``cause`` is ``extern``, ``event <name>`` or ``<skill> <id> <effect>``. ``stamp_ns`` is mission clock."""

    sequence: int
    stamp_ns: int
    resource: str
    from_state: str
    to_state: str
    cause: str
    skillset: str = ""

    @property
    def stamp_s(self) -> float:
        """Seconds of mission clock."""
        return self.stamp_ns / NANOSECONDS


EngineEvent = ExecutionEvent | TransitionEvent
Listener = Callable[[Sequence[EngineEvent]], None]
"""Gets the events of one atomic step; calls never overlap and are in the order of the steps."""


# --- as a record --------------------------------------------------------------------------------------------------------


def event_record(event: EngineEvent) -> dict[str, object]:
    """Return an event as ``json`` can write it: ``stamp_s`` in seconds, inputs as an object, outputs of an end too."""
    record: dict[str, object] = {"stamp_s": event.stamp_s, "sequence": event.sequence, "skillset": event.skillset}
    if isinstance(event, ExecutionEvent):
        record |= {"kind": EXECUTION, "skill": event.skill, "id": event.id, "state": event.state.value}
        record |= {"result": event.result, "message": event.message, "inputs": to_plain(event.inputs)}
        return {**record, "outputs": to_plain(event.outputs) if event.state.terminal else {}}
    record |= {"kind": TRANSITION, "resource": event.resource, "from_state": event.from_state, "to_state": event.to_state}
    return {**record, "cause": event.cause}


def read_event(record: Mapping[str, Any]) -> EngineEvent:
    """Return the event that a record was made of; names that may be missing are empty then.

    Raises:
        ValueError: it is no record of an event.
    """
    kind = str(record.get("kind"))
    if kind not in _READERS:
        raise ValueError(f"there is no kind of event {kind!r}; there are {', '.join(_READERS)}")
    try:
        return _READERS[kind](record, int(record.get("sequence", 0)), _stamp_ns(record), str(record.get("skillset", "")))
    except KeyError as error:
        raise ValueError(f"it has no {error.args[0]}") from error
    except (TypeError, OverflowError) as error:
        raise ValueError(str(error)) from error


def _stamp_ns(record: Mapping[str, Any]) -> int:
    return round(float(record["stamp_s"]) * NANOSECONDS)


def _execution_of(record: Mapping[str, Any], sequence: int, stamp_ns: int, skillset: str) -> ExecutionEvent:
    return ExecutionEvent(
        sequence=sequence,
        stamp_ns=stamp_ns,
        skill=str(record["skill"]),
        id=str(record["id"]),
        state=ExecutionState(record["state"]),
        result=str(record.get("result", "")),
        message=str(record.get("message", "")),
        inputs=record.get("inputs") or {},
        outputs=record.get("outputs") or {},
        skillset=skillset,
    )


def _transition_of(record: Mapping[str, Any], sequence: int, stamp_ns: int, skillset: str) -> TransitionEvent:
    return TransitionEvent(
        sequence=sequence,
        stamp_ns=stamp_ns,
        resource=str(record["resource"]),
        from_state=str(record["from_state"]),
        to_state=str(record["to_state"]),
        cause=str(record.get("cause", "")),
        skillset=skillset,
    )


_READERS: Mapping[str, Callable[[Mapping[str, Any], int, int, str], EngineEvent]] = {
    EXECUTION: _execution_of,
    TRANSITION: _transition_of,
}
