"""How a flight got over a fault: when it happened, when that was noticed, when the fallback ran, when the vehicle flew on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alula.common.scenarios import Scenario
from alula.records.causes.failures import SkillFailure, skill_failures
from alula.records.causes.faults import EARLY_S
from alula_flight.deaths import DIED
from alula_flight.report.answers import FaultAnswer
from alula_flight.report.events import History, PastExecution
from alula_flight.report.phases import Phases
from alula_flight.report.recording import Recording, Track

VIOLATED = "RESOURCE_INVARIANT_VIOLATED"
LOST = "LOST"  # how the skills end whose function is not heard of any more
BROKEN = "BROKEN"
MOVING_M_S = 0.2


@dataclass(frozen=True)
class Recovery:
    """Absolute seconds of mission clock; None: not known, or it did not happen. ``failed``: what failed; empty: not known."""

    failure_s: float | None
    detected_s: float | None
    fallback_running_s: float | None
    moving_again_s: float | None
    failed: str = ""


def find_recovery(
    scenario: Scenario, history: History, recording: Recording, phases: Phases, answers: Sequence[FaultAnswer]
) -> Recovery | None:
    """Return the recovery from the first fault in the air that the mission answered, or None where nothing failed there.

    Where it answered none: from what broke without a fault that is known; else from the first fault that was detected, else the first;
    these have no fallback. A fault before lift-off interrupts no flight.

    The scenario says which skill's running makes the flight safe again, and which take the vehicle on: a turn on the spot, or braking
    past the stop point and back, is not moving on.
    """
    flown = [one for one in answers if _in_the_air(one, phases)]
    answered = [one for one in flown if one.traced.failures]
    if answered:
        one = min(answered, key=lambda one: one.traced.failures[0].at)
        fallback_s = _fallback(scenario.fallback, history, one)
        return _recovery(one, fallback_s, _moving(scenario, history, recording, phases, fallback_s))
    noticed_s = _unexplained(history, answers)
    if noticed_s is not None:
        fallback_s = _first([e.running_s for e in history.executions if e.skill == scenario.fallback], noticed_s)
        return Recovery(None, noticed_s, fallback_s, _moving(scenario, history, recording, phases, fallback_s))
    broken = [one for one in flown if one.mode != DIED]  # the death of a process that nothing hung on interrupts no flight
    unanswered = [one for one in broken if one.traced.detected_s is not None] or broken
    return _recovery(unanswered[0], None, None) if unanswered else None


def _in_the_air(one: FaultAnswer, phases: Phases) -> bool:
    at_s = one.traced.fault.at_s
    ended = phases.touch_down_s is not None and at_s > phases.touch_down_s
    return not ended and (at_s >= phases.zero_s or not phases.lifted_off)


def _recovery(one: FaultAnswer, fallback_s: float | None, moving_s: float | None) -> Recovery:
    return Recovery(one.traced.fault.at_s, one.traced.detected_s, fallback_s, moving_s, one.what)


def _fallback(skill: str, history: History, one: FaultAnswer) -> float | None:
    """Return when the fallback ran in answer to a fault: in the branch that answered it, or before anything else failed."""
    first = one.traced.failures[0]
    others = [failure for failure in skill_failures(history.events) if failure.at > first.at and failure not in one.traced.failures]
    other_s = min((failure.end.stamp_s for failure in others), default=np.inf)

    def answers(execution: PastExecution) -> bool:
        in_branch = one.answer.branch in history.places.started.get(execution.id, ())
        return execution.running_s is not None and (in_branch or execution.running_s < other_s)

    runs = [execution.running_s for execution in history.executions if execution.skill == skill and answers(execution)]
    return _first(runs, first.end.stamp_s - EARLY_S)


def _unexplained(history: History, answers: Sequence[FaultAnswer]) -> float | None:
    """Return when the skill layer noticed something broken that follows from no fault that is known; None: never."""
    changes = {change for one in answers for change in one.traced.changes}
    explained = {failure.at for one in answers for failure in one.traced.failures}
    broken = [change.stamp_s for change in history.transitions if change.to_state == BROKEN and change not in changes]
    failed = [failure.end.stamp_s for failure in skill_failures(history.events) if _lost(failure) and failure.at not in explained]
    return min([*broken, *failed]) if broken else None


def _lost(failure: SkillFailure) -> bool:
    return failure.end.state.value == VIOLATED or failure.end.result == LOST


def _moving(scenario: Scenario, history: History, recording: Recording, phases: Phases, fallback_s: float | None) -> float | None:
    if fallback_s is None or recording.path is None:
        return None
    motion_s = _first([e.running_s for e in history.executions if e.skill in scenario.motion], fallback_s)
    return None if motion_s is None else moving_again(recording.path, motion_s, phases.landing_s)


def _first(stamps: Sequence[float | None], since_s: float) -> float | None:
    return min((stamp for stamp in stamps if stamp is not None and stamp >= since_s), default=None)


def moving_again(track: Track, since_s: float, landing_s: float | None) -> float | None:
    """Return when the vehicle is first fast (horizontally) from ``since_s`` on, when a motion skill runs again; None if it never is."""
    part = (track.t_s >= since_s) & (track.t_s < (np.inf if landing_s is None else landing_s))
    fast = track.t_s[part][track.horizontal_speed_m_s()[part] > MOVING_M_S]
    return float(fast[0]) if len(fast) else None
