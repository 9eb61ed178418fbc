"""``timeline.json``: which skill ran when, as rows of bars (skills) and of bands (resources), for the picture and other viewers."""

from __future__ import annotations

from typing import TypedDict

from alula.records.causes.alarms import Alarm, Alarms
from alula.report.history import History
from alula.report.phases import Phases
from alula.report.recovery import Recovery
from alula.report.rows import SkillSummary, skills
from alula.runtime.core.events import TransitionEvent

_COLOURS = {
    "RESOURCE_INVARIANT_VIOLATED": "violated",
    "INTERRUPTED": "interrupted",
    "RUNNING": "running",
    "REQUESTED": "running",
    "PAUSED": "running",
    "INTERRUPTING": "running",
    "NOT_VALIDATED": "failure",
    "NOT_READY": "failure",
    "FAILED": "failure",
}


class Bar(SkillSummary):
    """An execution; ``ending`` is success, ended, interrupted, violated, failure or running; ``until_s`` where its bar ends."""

    ending: str
    until_s: float


class SkillRow(TypedDict):
    """All executions of a skill."""

    skillset: str
    skill: str
    bars: list[Bar]


class Band(TypedDict):
    """A resource was in ``state`` from ``from_s`` to ``until_s``; ``alarm``: whether that is bad news (``alula.records.causes.alarms``)."""

    state: str
    alarm: bool
    from_s: float
    until_s: float


class ResourceRow(TypedDict):
    """A resource that changed during the run."""

    skillset: str
    resource: str
    bands: list[Band]


class Mark(TypedDict):
    """A moment that is marked through all rows."""

    t_s: float
    kind: str
    label: str


class Timeline(TypedDict):
    """Times are seconds since lift-off."""

    begin_s: float
    end_s: float
    skills: list[SkillRow]
    resources: list[ResourceRow]
    marks: list[Mark]


def make_timeline(history: History, phases: Phases, recovery: Recovery | None, alarms: Alarms) -> Timeline:
    """Return the rows of skills and resources and the marks, in seconds since lift-off."""
    begin_s, end_s = phases.since(history.first_s) or 0.0, phases.since(history.last_s) or 0.0
    return Timeline(
        begin_s=begin_s,
        end_s=end_s,
        skills=_skill_rows(skills(history, phases), end_s),
        resources=_resource_rows(history.transitions, phases, alarms, begin_s, end_s),
        marks=_marks(phases, recovery),
    )


def ending(outcome: str, result_kind: str) -> str:
    """Return how an execution ended, in six words; ``ended``: by a result that is neither a success nor a failure, or not known as one."""
    if outcome == "TERMINATED":
        return result_kind if result_kind in {"success", "failure"} else "ended"
    return _COLOURS.get(outcome, "failure")


def _skill_rows(executions: list[SkillSummary], end_s: float) -> list[SkillRow]:
    """Group by skillset, then by skill, both in the order of their first use."""
    rows: dict[tuple[str, str], SkillRow] = {}
    for execution in executions:
        until_s = end_s if execution["end_s"] is None else execution["end_s"]
        bar = Bar(**execution, ending=ending(execution["outcome"], execution["result_kind"]), until_s=until_s)
        key = (execution["skillset"], execution["skill"])
        rows.setdefault(key, SkillRow(skillset=key[0], skill=key[1], bars=[]))["bars"].append(bar)
    skillsets = list(dict.fromkeys(row["skillset"] for row in rows.values()))
    return sorted(rows.values(), key=lambda row: skillsets.index(row["skillset"]))


def _resource_rows(
    transitions: tuple[TransitionEvent, ...], phases: Phases, alarms: Alarms, begin_s: float, end_s: float
) -> list[ResourceRow]:
    rows: dict[tuple[str, str], ResourceRow] = {}
    for change in transitions:
        key = (change.skillset, change.resource)
        t_s = phases.since(change.stamp_s) or 0.0
        first = [Band(state=change.from_state, alarm=False, from_s=begin_s, until_s=t_s)]
        row = rows.setdefault(key, ResourceRow(skillset=key[0], resource=key[1], bands=first))
        row["bands"][-1]["until_s"] = t_s
        alarm = alarms.of(".".join(key), change.to_state) is Alarm.ALWAYS
        row["bands"].append(Band(state=change.to_state, alarm=alarm, from_s=t_s, until_s=end_s))
    skillsets = list(dict.fromkeys(row["skillset"] for row in rows.values()))
    return sorted(rows.values(), key=lambda row: skillsets.index(row["skillset"]))


def _marks(phases: Phases, recovery: Recovery | None) -> list[Mark]:
    if recovery is None:
        return []
    moments = [
        (recovery.failure_s, "failure", f"{recovery.failed or 'sensor'} fails"),
        (recovery.detected_s, "detected", "detected"),
        (recovery.fallback_running_s, "fallback", "fallback runs"),
        (recovery.moving_again_s, "moving", "moves again"),
    ]
    return [Mark(t_s=t_s, kind=kind, label=label) for stamp_s, kind, label in moments if (t_s := phases.since(stamp_s)) is not None]
