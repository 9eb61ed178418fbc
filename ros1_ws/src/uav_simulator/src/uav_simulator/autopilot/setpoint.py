"""Read SET_POSITION_TARGET_LOCAL_NED the way ArduCopter does: which groups a type mask leaves, in which frame they are.

Everything here is already ENU; the endpoint has turned the axes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_simulator.autopilot.estimator import Estimate
from uav_simulator.frames import Vec3

POSITION_BITS = 0x0007
VELOCITY_BITS = 0x0038
ACCEL_BITS = 0x01C0
FORCE_BIT = 0x0200
YAW_BIT = 0x0400
YAW_RATE_BIT = 0x0800

LOCAL_NED, LOCAL_OFFSET_NED, BODY_NED, BODY_OFFSET_NED = 1, 7, 8, 9
FRAMES = (LOCAL_NED, LOCAL_OFFSET_NED, BODY_NED, BODY_OFFSET_NED)


@dataclass(frozen=True)
class RawSetpoint:
    """The message's fields: vectors in ENU (body frames: x forward, y left, z up), yaw counter-clockwise from east."""

    frame: int
    type_mask: int
    position: Vec3
    velocity: Vec3
    yaw_rad: float
    yaw_rate_rad_s: float


@dataclass(frozen=True)
class Setpoint:
    """What is left of it: None for a group that is ignored; position relative to the origin."""

    position: Vec3 | None
    velocity: Vec3 | None
    yaw_rad: float | None
    yaw_rate_rad_s: float | None


def read_setpoint(raw: RawSetpoint, estimate: Estimate) -> Setpoint | None:
    """Return what is to be followed, or None when the combination of groups is none that ArduCopter follows.

    One ignored axis drops its whole group. Followed are: position, position and velocity, velocity; an acceleration rides
    along with both but not with a position alone; a force is an acceleration that must be ignored.
    """
    mask = raw.type_mask
    has_position = not mask & POSITION_BITS
    has_velocity = not mask & VELOCITY_BITS
    has_accel = not mask & ACCEL_BITS
    if raw.frame not in FRAMES or (mask & FORCE_BIT and has_accel):
        return None
    if not has_velocity and (has_accel or not has_position):
        return None
    position = _absolute(raw, estimate) if has_position else None
    velocity = _turned(raw, estimate, raw.velocity) if has_velocity else None
    yaw = raw.yaw_rad if not mask & YAW_BIT else None
    yaw_rate = raw.yaw_rate_rad_s if not mask & YAW_RATE_BIT else None
    if not all(math.isfinite(v) for v in (*(position or ()), *(velocity or ()), yaw or 0.0, yaw_rate or 0.0)):
        return None
    if yaw is not None and raw.frame in (BODY_NED, BODY_OFFSET_NED):
        yaw = estimate.yaw_rad + yaw - math.pi / 2.0  # relative to the nose; undoes the turn from north to east
    return Setpoint(position, velocity, yaw, yaw_rate)


def _turned(raw: RawSetpoint, estimate: Estimate, vector: Vec3) -> Vec3:
    """Return a vector of the message's frame along the axes of map."""
    if raw.frame not in (BODY_NED, BODY_OFFSET_NED):
        return vector
    c, s = math.cos(estimate.yaw_rad), math.sin(estimate.yaw_rad)
    return vector[0] * c - vector[1] * s, vector[0] * s + vector[1] * c, vector[2]


def _absolute(raw: RawSetpoint, estimate: Estimate) -> Vec3:
    """Return the position relative to the origin; frames 7 to 9 are offsets from the present one."""
    x, y, z = _turned(raw, estimate, raw.position)
    if raw.frame == LOCAL_NED:
        return x, y, z
    px, py, pz = estimate.position
    return px + x, py + y, pz + z
