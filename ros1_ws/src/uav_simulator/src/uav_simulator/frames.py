"""Conversions between the simulator's frames (map: ENU, body: FLU) and MAVLink's (NED, FRD).

Everything else in this package is ENU and FLU; only the MAVLink endpoint calls these functions.
"""

from __future__ import annotations

import math

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]  # w x y z

EARTH_RADIUS_M = 6378137.0  # WGS-84 equatorial radius; a sphere is enough for a yard


def ned_from_enu(v: Vec3) -> Vec3:
    """Return an ENU vector in NED; the same swap leads back."""
    return v[1], v[0], -v[2]


def enu_from_ned(v: Vec3) -> Vec3:
    """Return an NED vector in ENU."""
    return v[1], v[0], -v[2]


def frd_from_flu(v: Vec3) -> Vec3:
    """Return a body vector (forward, left, up) as (forward, right, down); the same signs lead back."""
    return v[0], -v[1], -v[2]


def wrap_pi(angle_rad: float) -> float:
    """Return the angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def yaw_ned_from_enu(yaw_rad: float) -> float:
    """Turn a yaw counter-clockwise from east into one clockwise from north, in [-pi, pi); the same formula leads back."""
    return wrap_pi(math.pi / 2.0 - yaw_rad)


def yaw_enu_from_ned(yaw_rad: float) -> float:
    """Turn a yaw clockwise from north into one counter-clockwise from east, in [-pi, pi)."""
    return wrap_pi(math.pi / 2.0 - yaw_rad)


def quat_ned_frd_from_enu_flu(q: Quat) -> Quat:
    """Return the attitude body FRD to NED for an attitude body FLU to ENU (both w x y z, w >= 0).

    q_NED_ENU (half a turn about the axis (1, 1, 0)/sqrt(2)) * q * q_FLU_FRD (half a turn about x), written out.
    """
    w, x, y, z = q
    s = math.sqrt(0.5)
    a, b, c, d = -s * (x + y), s * (w + z), s * (w - z), s * (y - x)
    out = (-b, a, d, -c)
    if out[0] < 0.0:
        return -out[0], -out[1], -out[2], -out[3]
    return out


def geodetic_from_enu(position_m: Vec3, origin: Vec3) -> Vec3:
    """Return (latitude deg, longitude deg, altitude m) of an ENU position about an origin of the same form (tangent plane)."""
    lat0, lon0, alt0 = origin
    lat = lat0 + math.degrees(position_m[1] / EARTH_RADIUS_M)
    lon = lon0 + math.degrees(position_m[0] / (EARTH_RADIUS_M * math.cos(math.radians(lat0))))
    return lat, lon, alt0 + position_m[2]
