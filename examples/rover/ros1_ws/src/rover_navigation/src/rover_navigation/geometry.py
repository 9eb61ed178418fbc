"""Poses in the plane, as (x, y, yaw): metres and radians."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Pose = tuple[float, float, float]
Points = NDArray[np.float64]
"""(N, 2), metres."""


def wrapped(angle_rad: float) -> float:
    """Return the angle within -pi and pi."""
    return math.remainder(angle_rad, math.tau)


def compose(T_a_b: Pose, T_b_c: Pose) -> Pose:
    """Return T_a_c."""
    cos, sin = math.cos(T_a_b[2]), math.sin(T_a_b[2])
    return T_a_b[0] + cos * T_b_c[0] - sin * T_b_c[1], T_a_b[1] + sin * T_b_c[0] + cos * T_b_c[1], wrapped(T_a_b[2] + T_b_c[2])


def inverse(T_a_b: Pose) -> Pose:
    """Return T_b_a."""
    cos, sin = math.cos(T_a_b[2]), math.sin(T_a_b[2])
    return -cos * T_a_b[0] - sin * T_a_b[1], sin * T_a_b[0] - cos * T_a_b[1], -T_a_b[2]


def transformed(T_a_b: Pose, points_b: Points) -> Points:
    """Return points of frame b in frame a."""
    cos, sin = math.cos(T_a_b[2]), math.sin(T_a_b[2])
    return np.asarray(points_b @ np.array([[cos, sin], [-sin, cos]]) + np.array(T_a_b[:2]), dtype=np.float64)


def points_of(ranges_m: NDArray[np.float64], angle_min_rad: float, angle_step_rad: float) -> Points:
    """Return what a sweep hit, in the laser's frame."""
    angles = angle_min_rad + angle_step_rad * np.arange(len(ranges_m))
    hit = np.isfinite(ranges_m)
    return np.column_stack((np.cos(angles[hit]), np.sin(angles[hit]))) * ranges_m[hit, None]


def along(ends: Points, begin_m: float, step_m: float, short_m: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return points along the beams to some ends, (N, K, 2), in steps; and which of them are so far before the beam's end, (N, K)."""
    far = np.linalg.norm(ends, axis=1)
    steps = np.arange(begin_m, far.max(initial=begin_m), step_m)
    return ends[:, None, :] / far[:, None, None] * steps[None, :, None], steps[None, :] < far[:, None] - short_m
