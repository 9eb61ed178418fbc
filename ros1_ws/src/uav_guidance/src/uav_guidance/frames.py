"""The only place where the autopilot's conventions meet ROS's: NED and FRD there, ENU and FLU here; type masks of setpoints."""

from __future__ import annotations

import math

from uav_guidance.vectors import Vec3

# SET_POSITION_TARGET_LOCAL_NED: bits of type_mask that make the autopilot IGNORE a field (MAVLink, POSITION_TARGET_TYPEMASK).
IGNORE_VELOCITY = 0x0038
IGNORE_ACCELERATION = 0x01C0
IGNORE_YAW_RATE = 0x0800
FOLLOW_POSITION_AND_YAW = IGNORE_VELOCITY | IGNORE_ACCELERATION | IGNORE_YAW_RATE  # 0x09F8

# ArduPilot's own factor (metres for 1e-7 degree of latitude): its local frame is made with it.
METRES_PER_1E7_DEGREE = 0.011131884502145034

Quaternion = tuple[float, float, float, float]


def wrap(angle_rad: float) -> float:
    """Return the same angle within [-pi, pi]."""
    return math.remainder(angle_rad, math.tau)


def enu_from_ned(v_ned: Vec3) -> Vec3:
    """Turn north-east-down into east-north-up; it is its own inverse."""
    return Vec3(v_ned.y, v_ned.x, -v_ned.z)


def ned_from_enu(v_enu: Vec3) -> Vec3:
    """Turn east-north-up into north-east-down."""
    return Vec3(v_enu.y, v_enu.x, -v_enu.z)


def yaw_enu_from_ned(yaw_ned_rad: float) -> float:
    """Turn clockwise from north into counter-clockwise from east; it is its own inverse."""
    return wrap(math.pi / 2.0 - yaw_ned_rad)


def yaw_ned_from_enu(yaw_enu_rad: float) -> float:
    """Turn counter-clockwise from east into clockwise from north."""
    return wrap(math.pi / 2.0 - yaw_enu_rad)


def quaternion_enu_flu(roll_rad: float, pitch_rad: float, yaw_ned_rad: float) -> Quaternion:
    """Return the attitude of an FLU body in ENU as (x, y, z, w), from the autopilot's roll, pitch (nose up positive), yaw of FRD in NED."""
    half_roll, half_pitch, half_yaw = roll_rad / 2.0, -pitch_rad / 2.0, yaw_enu_from_ned(yaw_ned_rad) / 2.0
    cr, sr = math.cos(half_roll), math.sin(half_roll)
    cp, sp = math.cos(half_pitch), math.sin(half_pitch)
    cy, sy = math.cos(half_yaw), math.sin(half_yaw)
    return (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)


def rates_flu_from_frd(rates_frd: Vec3) -> Vec3:
    """Turn body rates (rad/s) about forward-right-down into forward-left-up; it is its own inverse."""
    return Vec3(rates_frd.x, -rates_frd.y, -rates_frd.z)


def turned(quaternion: Quaternion, rates_body: Vec3, duration_s: float) -> Quaternion:
    """Return the attitude (x, y, z, w) after turning at body rates (rad/s) for a short time, which may be negative."""
    speed = rates_body.norm
    half = speed * duration_s / 2.0
    if abs(half) < 1e-9:
        return quaternion
    axis = rates_body * (math.sin(half) / speed)
    return product(quaternion, (axis.x, axis.y, axis.z, math.cos(half)))


def turned_about_vertical(quaternion: Quaternion, yaw_rad: float) -> Quaternion:
    """Return an attitude (x, y, z, w) in a frame that is turned clockwise by this angle."""
    return product((0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0)), quaternion)


def yaw_of(quaternion: Quaternion) -> float:
    """Return the heading of an attitude (x, y, z, w)."""
    x, y, z, w = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def rotated(quaternion: Quaternion, vector: Vec3) -> Vec3:
    """Return a vector turned by a unit quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    turned_x, turned_y, turned_z, _ = product(product(quaternion, (vector.x, vector.y, vector.z, 0.0)), (-x, -y, -z, w))
    return Vec3(turned_x, turned_y, turned_z)


def product(first: Quaternion, second: Quaternion) -> Quaternion:
    """Return the rotation (x, y, z, w) that turns by the second, then by the first."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def local_enu_from_global(place: tuple[int, int, int], origin: tuple[int, int, int]) -> Vec3:
    """Return where a place is in the local frame of an origin; both (latitude 1e-7 deg, longitude 1e-7 deg, altitude mm)."""
    narrowing = max(math.cos(math.radians((place[0] + origin[0]) * 0.5e-7)), 0.01)
    east = _longitude_difference(place[1], origin[1]) * METRES_PER_1E7_DEGREE * narrowing
    return Vec3(east, (place[0] - origin[0]) * METRES_PER_1E7_DEGREE, (place[2] - origin[2]) * 1e-3)


def _longitude_difference(a: int, b: int) -> int:
    """Return a - b in 1e-7 degrees, the short way round."""
    return (a - b + 1_800_000_000) % 3_600_000_000 - 1_800_000_000
