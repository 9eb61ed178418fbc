"""Executions and transitions of a run as rows of its summary; times are seconds since the departure."""

from __future__ import annotations

from typing import TypedDict

from alula.report.files import mapping
from alula.report.history import History
from alula.report.phases import Phases
from alula.runtime.core.events import kind_record


class SkillSummary(TypedDict):
    """One execution; ``outcome`` RUNNING or REQUESTED: its end was never seen. ``result_kind`` is as in the record of an event."""

    skillset: str
    skill: str
    id: str
    inputs: dict[str, object]
    start_s: float | None
    running_s: float | None
    end_s: float | None
    outcome: str
    result: str
    result_kind: str
    message: str


ResourceSummary = TypedDict(
    "ResourceSummary",
    {"t_s": float | None, "skillset": str, "resource": str, "from": str, "to": str, "cause": str, "reason": str},
)


def skills(history: History, phases: Phases) -> list[SkillSummary]:
    """Return the executions in the order of their requests."""
    return [
        SkillSummary(
            skillset=execution.skillset,
            skill=execution.skill,
            id=execution.id,
            inputs=mapping(execution.inputs),
            start_s=phases.since(execution.requested_s),
            running_s=phases.since(execution.started_s),
            end_s=phases.since(execution.ended_s),
            outcome=execution.state.value,
            result=execution.result,
            result_kind=kind_record(execution.result_kind),
            message=execution.message,
        )
        for execution in history.executions
    ]


def resources(history: History, phases: Phases) -> list[ResourceSummary]:
    """Return the transitions in the order of time."""
    return [
        {
            "t_s": phases.since(change.stamp_s),
            "skillset": change.skillset,
            "resource": change.resource,
            "from": change.from_state,
            "to": change.to_state,
            "cause": change.cause,
            "reason": change.reason,
        }
        for change in history.transitions
    ]
