"""Quaternions (w, x, y, z) and vectors as plain tuples: at 400 Hz small numpy arrays would cost ten times as much."""

from __future__ import annotations

import math

from uav_simulator.frames import Quat, Vec3


def multiply(p: Quat, q: Quat) -> Quat:
    """Return the Hamilton product p q."""
    a, b, c, d = p
    w, x, y, z = q
    return (a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y, a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w)


def rotate(q: Quat, v: Vec3) -> Vec3:
    """Turn a vector by a unit quaternion (body to world for an attitude)."""
    w, x, y, z = q
    vx, vy, vz = v
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


def from_yaw(yaw_rad: float) -> Quat:
    """Return the level attitude with a yaw counter-clockwise from east."""
    return math.cos(yaw_rad / 2.0), 0.0, 0.0, math.sin(yaw_rad / 2.0)


def euler_zyx(q: Quat) -> Vec3:
    """Return roll, pitch, yaw in radians of the rotation (z-y-x convention)."""
    w, x, y, z = q
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def tilted(up: Vec3, yaw_rad: float) -> Quat:
    """Return the attitude whose body z axis is the unit vector ``up`` and whose heading before tilting is ``yaw_rad``."""
    # Shortest turn from vertical to `up`, after the yaw: q = q_tilt q_yaw.
    w = math.sqrt(max(1e-9, (1.0 + up[2]) / 2.0))
    return multiply((w, -up[1] / (2.0 * w), up[0] / (2.0 * w), 0.0), from_yaw(yaw_rad))


def rotation_vector(before: Quat, after: Quat) -> Vec3:
    """Return the rotation from one attitude to another in the first one's body axes, radians; for small rotations."""
    w, x, y, z = before
    dw, dx, dy, dz = multiply((w, -x, -y, -z), after)
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if length < 1e-12:
        return 0.0, 0.0, 0.0
    scale = 2.0 * math.atan2(length, abs(dw)) / length * (1.0 if dw >= 0.0 else -1.0)
    return dx * scale, dy * scale, dz * scale
