"""How a flight got over a broken sensor: when it broke, when that was noticed, when the fallback ran, when it flew on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alula_common.scenarios import Scenario
from alula_flight.report.events import History, PastExecution
from alula_flight.report.phases import Phases
from alula_flight.report.recording import FaultChange, Recording, Track

VIOLATED = "RESOURCE_INVARIANT_VIOLATED"
LOST = "LOST"  # how the skills end whose function is not heard of any more
BROKEN = "BROKEN"
MENDED = "ok"
MOVING_M_S = 0.2
# The managers' clock ticks at 50 Hz, so an event's stamp may be a tick older than what caused it.
STAMP_TOLERANCE_S = 0.05


@dataclass(frozen=True)
class Recovery:
    """Absolute seconds of mission clock; None: not known, or it did not happen. ``failed``: what failed; empty: not known."""

    failure_s: float | None
    detected_s: float | None
    fallback_running_s: float | None
    moving_again_s: float | None
    failed: str = ""


def injected(recording: Recording) -> tuple[FaultChange, ...]:
    """Return what the simulator and the supervisor broke, in the order of time."""
    faults = recording.simulator.faults if recording.simulator is not None else ()
    return tuple(sorted((fault for fault in (*faults, *recording.processes) if fault.mode != MENDED), key=lambda fault: fault.t_s))


def find_recovery(
    scenario: Scenario, history: History, recording: Recording, phases: Phases, *, radio_lost_s: float | None = None
) -> Recovery | None:
    """Return the recovery from the first failure, or None without one. ``radio_lost_s``: when the radio was lost that ended the video.

    The scenario says which skill's running makes the flight safe again, and which take the vehicle on: a turn on the spot, or braking
    past the stop point and back, is not moving on.
    """
    faults = injected(recording)
    broken = [change.stamp_s for change in history.transitions if change.to_state == BROKEN]
    if not faults and not broken and radio_lost_s is None:
        return None
    failure_s, failed = _failure(recording, radio_lost_s)
    since_s = -np.inf if failure_s is None else failure_s - STAMP_TOLERANCE_S
    violated = [e.end_s for e in history.executions if (e.outcome == VIOLATED or e.result == LOST) and e.end_s is not None]
    detected_s = _first([*broken, *violated], since_s)
    fallback_s = _fallback(scenario.fallback, history.executions, since_s if detected_s is None else detected_s)
    motion_s = None if fallback_s is None else _first(_running_stamps(history, scenario.motion), fallback_s)
    moving_s = None if motion_s is None or recording.path is None else moving_again(recording.path, motion_s, phases.landing_s)
    return Recovery(failure_s, detected_s, fallback_s, moving_s, failed)


def _failure(recording: Recording, radio_lost_s: float | None) -> tuple[float | None, str]:
    """Return when the first failure happened, and of what; a process that died is not told as the radio, whatever that was like."""
    dead = [fault.t_s for fault in recording.processes if fault.mode != MENDED]
    if radio_lost_s is not None and not dead:
        return radio_lost_s, "radio"
    first = next(iter(injected(recording)), None)
    return (None, "") if first is None else (first.t_s, first.sensor)


def _running_stamps(history: History, skills: tuple[str, ...]) -> list[float]:
    return [e.running_s for e in history.executions if e.skill in skills and e.running_s is not None]


def _first(stamps: list[float], since_s: float) -> float | None:
    return min((stamp for stamp in stamps if stamp >= since_s), default=None)


def _fallback(skill: str, executions: tuple[PastExecution, ...], since_s: float) -> float | None:
    """Return when the fallback skill came to run; one that was running before the failure needs no mention."""
    return _first([e.running_s for e in executions if e.skill == skill and e.running_s is not None], since_s)


def moving_again(track: Track, since_s: float, landing_s: float | None) -> float | None:
    """Return when the vehicle is first fast (horizontally) from ``since_s`` on, when a motion skill runs again; None if it never is."""
    part = (track.t_s >= since_s) & (track.t_s < (np.inf if landing_s is None else landing_s))
    fast = track.t_s[part][track.horizontal_speed_m_s()[part] > MOVING_M_S]
    return float(fast[0]) if len(fast) else None
