"""What an engine tells its listener, and how it is written down: one record for files, reports and all listeners."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypedDict

from alula.common.plain import to_plain
from alula.model.execution_state import ExecutionState
from alula.model.model import ResultKind
from alula.model.unmet import Unmet

NANOSECONDS = 1e9
EXECUTION = "EXECUTION"
TRANSITION = "TRANSITION"
_FAILED = frozenset(
    {ExecutionState.NOT_VALIDATED, ExecutionState.NOT_READY, ExecutionState.RESOURCE_INVARIANT_VIOLATED, ExecutionState.FAILED}
)


@dataclass(frozen=True)
class ExecutionEvent:
    """An execution entered ``state``; ``result`` and ``unmet`` are as in ``Execution``. ``stamp_ns`` is mission clock.

    ``result_kind`` is that of the result when TERMINATED (see ``Skill.kind_of``), else None; also where a record does not say it.
    ``instance_id`` is that of the managers, new at each of their starts; empty without managers, and where a record does not say it.
    """

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
    result_kind: ResultKind | None = None
    unmet: tuple[Unmet, ...] = ()
    instance_id: str = ""

    @property
    def stamp_s(self) -> float:
        """Stamp in seconds of mission clock."""
        return self.stamp_ns / NANOSECONDS

    @property
    def failed(self) -> bool:
        """Return whether it is the end of an execution that failed: by a failure of the model, a violation, a refusal or an error."""
        return self.result_kind is ResultKind.FAILURE if self.state is ExecutionState.TERMINATED else self.state in _FAILED


@dataclass(frozen=True)
class TransitionEvent:
    """A resource changed; ``cause`` is ``extern``, ``event <name>`` or ``<skill> <id> <effect>``. ``stamp_ns`` is mission clock.

    ``reason``: why, in the words of the functional layer's report; empty where it told none. ``instance_id`` as of an execution's event.
    """

    sequence: int
    stamp_ns: int
    resource: str
    from_state: str
    to_state: str
    cause: str
    skillset: str = ""
    reason: str = ""
    instance_id: str = ""

    @property
    def stamp_s(self) -> float:
        """Stamp in seconds of mission clock."""
        return self.stamp_ns / NANOSECONDS


EngineEvent = ExecutionEvent | TransitionEvent
Listener = Callable[[Sequence[EngineEvent]], None]
"""Gets the events of one atomic step; calls never overlap and are in the order of the steps."""


# --- as a record --------------------------------------------------------------------------------------------------------


def event_record(event: EngineEvent) -> dict[str, object]:
    """Return an event as ``json`` can write it: ``stamp_s`` in seconds, inputs as an object, outputs of an end too.

    Seconds, as all that people and tools plot in a record. They are read back to the nanosecond for the first 24 days (2 ** 21 s) of a
    clock, as those of simulations are, and to 0.2 us for a clock that counts from 1970; ``sequence`` keeps the order of what is closer.
    """
    record: dict[str, object] = {"stamp_s": event.stamp_s, "instance_id": event.instance_id}
    record |= {"sequence": event.sequence, "skillset": event.skillset}
    if isinstance(event, ExecutionEvent):
        record |= {"kind": EXECUTION, "skill": event.skill, "id": event.id, "state": event.state.value}
        record |= {"result": event.result, "result_kind": kind_record(event.result_kind), "unmet": unmet_record(event.unmet)}
        record |= {"message": event.message, "inputs": to_plain(event.inputs)}
        return {**record, "outputs": to_plain(event.outputs) if event.state.terminal else {}}
    record |= {"kind": TRANSITION, "resource": event.resource, "from_state": event.from_state, "to_state": event.to_state}
    return {**record, "cause": event.cause, "reason": event.reason}


def kind_record(kind: ResultKind | None) -> str:
    """Return the kind of a result in a record, "" for none."""
    return "" if kind is None else kind.value


def read_kind(record: object) -> ResultKind | None:
    """Return the kind of a result, None where a record does not say it; raises ValueError."""
    return ResultKind(record) if record else None


def unmet_record(unmet: Sequence[Unmet]) -> list[dict[str, object]]:
    """Return what was unmet as ``json`` can write it: objects with the fields of ``Unmet``."""
    return [to_plain(one) for one in unmet]


def read_unmet(record: Any) -> tuple[Unmet, ...]:
    """Return what was unmet; raises KeyError, TypeError or ValueError."""
    return tuple(
        Unmet(
            name=str(one["name"]),
            condition=str(one["condition"]),
            reason=str(one["reason"]),
            states={name: str(state) for name, state in dict(one["states"]).items()},
            data=dict(one["data"]),
        )
        for one in record or ()
    )


def read_event(record: Mapping[str, Any]) -> EngineEvent:
    """Return the event that a record was made of; names that may be missing are empty then.

    Raises:
        ValueError: it is no record of an event.
    """
    kind = str(record.get("kind"))
    if kind not in _READERS:
        raise ValueError(f"there is no kind of event {kind!r}; there are {', '.join(_READERS)}")
    try:
        return _READERS[kind](record)
    except KeyError as error:
        raise ValueError(f"it has no {error.args[0]}") from error
    except (TypeError, OverflowError) as error:
        raise ValueError(str(error)) from error


class _Common(TypedDict):
    """What the events of both kinds have."""

    sequence: int
    stamp_ns: int
    skillset: str
    instance_id: str


def _common(record: Mapping[str, Any]) -> _Common:
    return {
        "sequence": int(record.get("sequence", 0)),
        "stamp_ns": round(float(record["stamp_s"]) * NANOSECONDS),
        "skillset": str(record.get("skillset", "")),
        "instance_id": str(record.get("instance_id", "")),
    }


def _execution_of(record: Mapping[str, Any]) -> ExecutionEvent:
    return ExecutionEvent(
        **_common(record),
        skill=str(record["skill"]),
        id=str(record["id"]),
        state=ExecutionState(record["state"]),
        result=str(record.get("result", "")),
        message=str(record.get("message", "")),
        inputs=record.get("inputs") or {},
        outputs=record.get("outputs") or {},
        result_kind=read_kind(record.get("result_kind")),
        unmet=read_unmet(record.get("unmet")),
    )


def _transition_of(record: Mapping[str, Any]) -> TransitionEvent:
    return TransitionEvent(
        **_common(record),
        resource=str(record["resource"]),
        from_state=str(record["from_state"]),
        to_state=str(record["to_state"]),
        cause=str(record.get("cause", "")),
        reason=str(record.get("reason", "")),
    )


_READERS: Mapping[str, Callable[[Mapping[str, Any]], EngineEvent]] = {
    EXECUTION: _execution_of,
    TRANSITION: _transition_of,
}
