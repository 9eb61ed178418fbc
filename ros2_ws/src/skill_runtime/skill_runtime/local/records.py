"""Events as records that ``json`` can write: the same fields as a skillset_interfaces/Event has."""

from __future__ import annotations

from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.plain import to_plain


def event_record(skillset: str, event: EngineEvent) -> dict[str, object]:
    """Return an event as a mission writes it: ``stamp_s`` is mission clock, inputs and outputs are objects."""
    record: dict[str, object] = {"stamp_s": event.stamp_ns / 1e9, "sequence": event.sequence, "skillset": skillset}
    if isinstance(event, ExecutionEvent):
        record |= {"kind": "EXECUTION", "skill": event.skill, "id": event.id, "state": event.state.value}
        record |= {"result": event.result, "message": event.message, "inputs": to_plain(event.inputs)}
        record["outputs"] = to_plain(event.outputs) if event.state.terminal else {}
        return record
    record |= {"kind": "TRANSITION", "resource": event.resource, "from_state": event.from_state, "to_state": event.to_state}
    return {**record, "cause": event.cause}
