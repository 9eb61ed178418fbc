"""When does a skill end, and how? Pure functions from what the functional layer reports to a verdict, or None to go on.

They are the body of ``_CB_new_position`` in the paper's Listing 4, one function a skill. No ROS is needed to use them:
anything with the fields of uav_msgs/GuidanceState will do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

ON_GROUND = 1  # uav_msgs/GuidanceState.landed_state
IN_AIR = 2


class GuidanceReport(Protocol):
    """The fields of uav_msgs/GuidanceState that decide; metres, radians, seconds of mission clock."""

    landed_state: int
    armed: bool
    reference: str
    reference_id: int
    distance_to_go_m: float
    vertical_to_go_m: float
    drift_m: float
    heading_error_rad: float
    still_s: float
    obstacle_stop: bool
    obstacle_m: float
    unwatched: bool


@dataclass(frozen=True)
class SkillEnd:
    """How an execution ends: a result of the skill's model, and why in words."""

    result: str
    message: str = ""


@dataclass(frozen=True, kw_only=True)
class Thresholds:
    """What counts as arrived, aligned, off course, blocked or silent."""

    altitude_m: float = 0.3
    takeoff_drift_m: float = 2.0
    arrival_m: float = 0.35
    goto_drift_m: float = 3.0
    heading_rad: float = 0.06
    blocked_s: float = 5.0
    spool_up_s: float = 12.0
    landing_blocked_s: float = 15.0
    reference_lost_s: float = 3.0
    silence_s: float = 2.0
    mapping_silence_s: float = 3.0
    encoder_silence_s: float = 1.0  # less than what the data `picture` takes to be stale and to break the video's criteria


DEFAULT_THRESHOLDS = Thresholds()
UNHEARD = "it has died, or the link to it is lost"
PUSHED = "the wind, or an autopilot that does not follow"


def _blocked(state: GuidanceReport, limits: Thresholds) -> SkillEnd | None:
    if state.still_s <= limits.blocked_s:
        return None
    if state.unwatched:
        return SkillEnd("BLOCKED", f"held back for {state.still_s:.1f} s: no sensor watches the way ahead")
    if state.obstacle_stop:
        return SkillEnd("BLOCKED", f"held back for {state.still_s:.1f} s by an obstacle {state.obstacle_m:.1f} m ahead")
    return SkillEnd("BLOCKED", f"no nearer to the target for {state.still_s:.1f} s, and nothing seen in the way: {PUSHED}")


def _drifted(state: GuidanceReport, limit_m: float) -> SkillEnd | None:
    if state.drift_m <= limit_m:
        return None
    return SkillEnd("ABORTED", f"{state.drift_m:.1f} m off the line, more than {limit_m:.1f} m: {PUSHED}")


def decide_takeoff(state: GuidanceReport, limits: Thresholds = DEFAULT_THRESHOLDS) -> SkillEnd | None:
    """End a take-off: AT_ALTITUDE, ABORTED by drift, or BLOCKED (paper, Listing 4)."""
    if state.landed_state == IN_AIR and abs(state.vertical_to_go_m) < limits.altitude_m:
        return SkillEnd("AT_ALTITUDE")
    if state.landed_state == ON_GROUND and state.still_s <= limits.spool_up_s:
        return None  # arming and spooling up take 4 s, more on a busy machine
    return _drifted(state, limits.takeoff_drift_m) or _blocked(state, limits)


def decide_goto(state: GuidanceReport, limits: Thresholds = DEFAULT_THRESHOLDS) -> SkillEnd | None:
    """End a flight to a point: ARRIVED, ABORTED by drift, or BLOCKED."""
    if state.distance_to_go_m < limits.arrival_m:
        return SkillEnd("ARRIVED")
    return _drifted(state, limits.goto_drift_m) or _blocked(state, limits)


def decide_rotation(state: GuidanceReport, limits: Thresholds = DEFAULT_THRESHOLDS) -> SkillEnd | None:
    """End a turn on the spot: ALIGNED, or BLOCKED when it does not turn on."""
    if abs(state.heading_error_rad) < limits.heading_rad:
        return SkillEnd("ALIGNED")
    return _blocked(state, limits)


def decide_landing(state: GuidanceReport, limits: Thresholds = DEFAULT_THRESHOLDS) -> SkillEnd | None:
    """End a landing: LANDED on the ground with the motors off, or BLOCKED when it does not come lower for long."""
    if state.landed_state == ON_GROUND:
        return None if state.armed else SkillEnd("LANDED")
    if state.still_s > limits.landing_blocked_s:
        return SkillEnd("BLOCKED", f"no lower for {state.still_s:.1f} s")
    return None


def decide_hover(hovered_s: float, duration_s: float) -> SkillEnd | None:
    """End a hover when it has lasted."""
    return SkillEnd("DONE") if hovered_s >= duration_s else None


def speaks_of(state: GuidanceReport, *, kind: str, reference_id: int) -> bool:
    """Return whether a state is about a reference: a dropped one (``idle``) keeps its id, and has nothing to go any more."""
    return state.reference_id == reference_id and state.reference == kind


def decide_watch(silent_s: float, source: str, limits: Thresholds = DEFAULT_THRESHOLDS) -> SkillEnd | None:
    """End a depth map whose obstacle messages stopped; ``silent_s`` counts from the start until there was one."""
    if silent_s <= limits.silence_s:
        return None
    return SkillEnd("LOST", f"no obstacle message of the {source} for {silent_s:.1f} s: {UNHEARD}")


def decide_stream(silent_s: float, *, told_idle: bool, limits: Thresholds = DEFAULT_THRESHOLDS) -> SkillEnd | None:
    """End a stream whose encoder no longer says that it sends; ``told_idle``: it says that it doesn't, as one that was restarted."""
    if silent_s <= limits.encoder_silence_s:
        return None
    if told_idle:
        return SkillEnd("LOST", "the video encoder was started again and sends nothing")
    return SkillEnd("LOST", f"nothing was heard of the video encoder for {silent_s:.1f} s: {UNHEARD}")


def decide_mapping(silent_s: float, lidar_fault: str, limits: Thresholds = DEFAULT_THRESHOLDS) -> SkillEnd | None:
    """End a mapping that registers no more scans; ``silent_s`` counts from the start until there was one.

    ``lidar_fault``: what is said to be wrong with the LiDAR, empty for nothing: then it is the mapping that is silent.
    """
    if silent_s <= limits.mapping_silence_s:
        return None
    cause = f"; the LiDAR: {lidar_fault}" if lidar_fault else ""
    return SkillEnd("ABORTED", f"no scan registered for {silent_s:.1f} s{cause}")


def remaining_part(remaining: float, initial: float) -> float:
    """Return the progress 0..1 of a motion with ``remaining`` of ``initial`` metres or radians to go."""
    if not initial > 0.0:
        return 1.0
    return min(1.0, max(0.0, 1.0 - remaining / initial))
