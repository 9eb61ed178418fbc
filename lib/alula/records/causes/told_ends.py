"""Complete a run's events by the ends that only the mission's record has: managers that died publish no event."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from alula.common.record import REPORTS, Entry
from alula.model.execution_state import ExecutionState
from alula.records.kinds import with_kinds
from alula.runtime.core.events import EngineEvent, ExecutionEvent

ENDS = frozenset(state.value for state in ExecutionState if state.terminal)


def with_told_ends(events: Sequence[EngineEvent], entries: Iterable[Entry]) -> list[EngineEvent]:
    """Return a run's events in the order of time, with the ends that only reports to the mission show.

    Kinds of results that are not told are those of the robot's model.

    Args:
        events: of all skillsets.
        entries: of the run's record.
    """
    executions = [event for event in events if isinstance(event, ExecutionEvent)]
    open_ = {(one.skillset, one.id): one for one in executions}
    for one in executions:
        if one.state.terminal:
            open_.pop((one.skillset, one.id), None)
    ends = []
    for entry in entries if open_ else ():
        begun = open_.get((str(entry.value.get("skillset")), str(entry.value.get("id")))) if entry.topic == REPORTS else None
        if begun is not None and entry.value.get("state") in ENDS:
            del open_[begun.skillset, begun.id]
            ends.append(_end(begun, entry))
    return with_kinds(sorted([*events, *ends], key=lambda event: event.stamp_ns) if ends else events)


def _end(begun: ExecutionEvent, entry: Entry) -> ExecutionEvent:
    told, state = entry.value, ExecutionState(entry.value["state"])
    result, message = str(told.get("result") or ""), str(told.get("message") or "")
    return ExecutionEvent(0, entry.stamp_ns, begun.skill, begun.id, state, result, message, {}, told.get("outputs") or {}, begun.skillset)
