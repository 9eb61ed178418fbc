"""The kinds of results that a record does not say: older ones, and reports to the mission. The robot's model knows them, or nobody."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from alula.model.execution_state import ExecutionState
from alula.model.model import ResultKind
from alula.records.errors import AnalysisError
from alula.records.models import robot_skillsets
from alula.runtime.core.events import EngineEvent, TransitionEvent, kind_record


def kind_of(skillset: str, skill: str, result: str) -> ResultKind | None:
    """Return the kind of a result by the robot's model; None where there is no robot, or it has no such result."""
    try:
        (model,) = robot_skillsets([skillset])
        return model.skill(skill).kind_of(result)
    except (AnalysisError, KeyError):
        return None


def with_kinds(events: Iterable[EngineEvent]) -> list[EngineEvent]:
    """Return events with the kinds of their results, as far as they are known."""
    return [_with_kind(event) for event in events]


def with_kind(record: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the record of an event with the kind of its result, as far as it is known."""
    if record.get("state") != ExecutionState.TERMINATED.value or record.get("result_kind"):
        return record
    names = (str(record.get(name, "")) for name in ("skillset", "skill", "result"))
    return {**record, "result_kind": kind_record(kind_of(*names))}


def _with_kind(event: EngineEvent) -> EngineEvent:
    if isinstance(event, TransitionEvent) or event.state is not ExecutionState.TERMINATED or event.result_kind is not None:
        return event
    return replace(event, result_kind=kind_of(event.skillset, event.skill, event.result))
