"""Measure the recovery from a fault: when it happened, was detected, when the fallback ran, when the robot moved on."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from alula.common.faults import DIED
from alula.common.scenarios import Scenario
from alula.model.execution_state import ExecutionState
from alula.records.causes.alarms import Alarm, Alarms
from alula.records.causes.faults import EARLY_S
from alula.report.history import History
from alula.report.observed import Observed
from alula.report.phases import Phases
from alula.report.responses import FaultResponse
from alula.runtime.core.records import ExecutionRecord

ENDED_BY_ITSELF = frozenset({ExecutionState.RESOURCE_INVARIANT_VIOLATED, ExecutionState.TERMINATED, ExecutionState.FAILED})
"""How what ran can fail: all other failures are refusals to start."""


@dataclass(frozen=True)
class Recovery:
    """Absolute seconds of mission clock; None: not known, or it did not happen. ``failed``: what failed; empty: not known."""

    failure_s: float | None
    detected_s: float | None
    fallback_running_s: float | None
    moving_again_s: float | None
    failed: str = ""


def find_recovery(
    scenario: Scenario, history: History, observed: Observed, phases: Phases, responses: Sequence[FaultResponse], alarms: Alarms
) -> Recovery | None:
    """Return the recovery from the first fault in the air with a response of the mission, or None where nothing failed there.

    Where there was none: from what broke without a fault that is known; else from the first fault that was detected, else the first;
    these have no fallback. A fault before lift-off interrupts no flight.

    The scenario says which skill's running makes the flight safe again, and which take the vehicle on: a turn on the spot, or braking
    past the stop point and back, is not moving on.
    """
    flown = [one for one in responses if _in_the_air(one, phases)]
    followed = [one for one in flown if one.traced.failures]
    if followed:
        one = min(followed, key=lambda one: one.traced.failures[0].at)
        fallback_s = _fallback(scenario.fallback, history, one)
        return _recovery(one, fallback_s, _moving(scenario, history, observed, fallback_s))
    noticed_s = _unexplained(history, responses, alarms)
    if noticed_s is not None:
        fallback_s = _first([e.started_s for e in history.executions if _is_one(e, [scenario.fallback])], noticed_s)
        return Recovery(None, noticed_s, fallback_s, _moving(scenario, history, observed, fallback_s))
    broken = [one for one in flown if one.mode != DIED]  # the death of a process that nothing hung on interrupts no flight
    unfollowed = [one for one in broken if one.traced.detected_s is not None] or broken
    return _recovery(unfollowed[0], None, None) if unfollowed else None


def _in_the_air(one: FaultResponse, phases: Phases) -> bool:
    at_s = one.traced.fault.at_s
    ended = phases.back_s is not None and at_s > phases.back_s
    return not ended and (at_s >= phases.zero_s or not phases.departed)


def _recovery(one: FaultResponse, fallback_s: float | None, moving_s: float | None) -> Recovery:
    return Recovery(one.traced.fault.at_s, one.traced.detected_s, fallback_s, moving_s, one.what)


def _fallback(skill: str, history: History, one: FaultResponse) -> float | None:
    """Return when the fallback ran in response to a fault: in the branch that took over, or before anything else failed."""
    first = one.traced.failures[0]
    others = [failure for failure in history.failures if failure.at > first.at and failure not in one.traced.failures]
    other_s = min((failure.end.stamp_s for failure in others), default=math.inf)

    def responds(execution: ExecutionRecord) -> bool:
        in_branch = one.response.branch in history.places.started.get(execution.id, ())
        return execution.started_s is not None and (in_branch or execution.started_s < other_s)

    runs = [execution.started_s for execution in history.executions if _is_one(execution, [skill]) and responds(execution)]
    return _first(runs, first.end.stamp_s - EARLY_S)


def _unexplained(history: History, responses: Sequence[FaultResponse], alarms: Alarms) -> float | None:
    """Return when the skill layer noticed something broken that follows from no fault that is known; None: never."""
    changes = {change for one in responses for change in one.traced.changes}
    explained = {failure.at for one in responses for failure in one.traced.failures}
    broken = [
        change.stamp_s
        for change in history.transitions
        if alarms.of(f"{change.skillset}.{change.resource}", change.to_state) is Alarm.ALWAYS and change not in changes
    ]
    ended = [failure for failure in history.failures if failure.end.state in ENDED_BY_ITSELF]
    failed = [failure.end.stamp_s for failure in ended if failure.at not in explained]
    return min([*broken, *failed]) if broken else None


def _moving(scenario: Scenario, history: History, observed: Observed, fallback_s: float | None) -> float | None:
    """Return when the robot moves on: when it is first seen to move since a skill of motion runs again."""
    if fallback_s is None or observed.moving_again is None:
        return None
    motion_s = _first([e.started_s for e in history.executions if _is_one(e, scenario.motion)], fallback_s)
    return None if motion_s is None else observed.moving_again(motion_s)


def _is_one(execution: ExecutionRecord, skills: Collection[str]) -> bool:
    """Return whether an execution is of one of some skills, which a scenario names with their skillset or without."""
    return execution.skill in skills or f"{execution.skillset}.{execution.skill}" in skills


def _first(stamps: Sequence[float | None], since_s: float) -> float | None:
    return min((stamp for stamp in stamps if stamp is not None and stamp >= since_s), default=None)
