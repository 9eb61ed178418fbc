"""A yard of planes for the tests: what a LiDAR sees from a pose, and what an IMU feels on a path through it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from lidar_mapping import ImuReading
from perception_core import NS, PoseBuffer, Sweep

GRAVITY = np.array([0.0, 0.0, 9.81])
IMU_NS = 10_000_000
SWEEP_NS = 100_000_000
NOISE_M = 0.01


GROUNDS = {"flat": lambda _x: 0.0, "slope": lambda x: 0.08 * x, "roof": lambda x: 1.0 * (x > 0.0)}
"""Its height by x."""


def yard(count, seed=0, *, corridor=False, ground="flat"):
    """Points (N, 3) on the ground, four walls of 20 x 14 m and some crates; as a corridor only ground and two long bare walls."""
    rng = np.random.default_rng(seed)
    if corridor:
        planes = [("z", 0.0, (-40, 40), (-3, 3)), ("y", -3.0, (-40, 40), (0, 4)), ("y", 3.0, (-40, 40), (0, 4))]
    else:
        planes = [("z", 0.0, (-10, 10), (-7, 7)), ("y", -7.0, (-10, 10), (0, 4)), ("y", 7.0, (-10, 10), (0, 4))]
        planes += [("x", -10.0, (-7, 7), (0, 4)), ("x", 10.0, (-7, 7), (0, 4))]
        for x, y in ((-6, -5), (-2, 5), (3, -4), (6, 4), (8, -6)):
            planes += [("x", x + side, (y - 0.5, y + 0.5), (0, 1.5)) for side in (-0.5, 0.5)]
            planes += [("y", y + side, (x - 0.5, x + 0.5), (0, 1.5)) for side in (-0.5, 0.5)]
    areas = np.array([(a[1] - a[0]) * (b[1] - b[0]) for _, _, a, b in planes], dtype=float)
    parts = []
    for (axis, at, a, b), share in zip(planes, areas / areas.sum(), strict=True):
        n = max(20, int(share * count))
        u, v, w = rng.uniform(*a, n), rng.uniform(*b, n), np.full(n, at)
        parts.append(np.stack({"x": (w, u, v), "y": (u, w, v), "z": (u, v, w + GROUNDS[ground](u))}[axis], axis=1))
    return np.vstack(parts)


class Path:
    """A vehicle on a smooth path: ``position(t)`` (3,), ``yaw(t)``; seconds.

    Its LiDAR sees what lies within ``across_deg`` of the plane across its heading.
    """

    def __init__(self, position, yaw=lambda _t: 0.0, *, corridor=False, reach_m=12.0, across_deg=90.0, ground="flat") -> None:
        self.position, self.yaw, self._ground = position, yaw, ground
        self._corridor, self._reach_m, self._across = corridor, reach_m, np.sin(np.radians(across_deg))

    def pose(self, t):
        transform, yaw = np.eye(4), self.yaw(t)
        transform[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
        transform[:3, 3] = self.position(t)
        return transform

    def reading(self, t, rng):
        """What an IMU measures, with white noise."""
        h = 1e-3
        acceleration = (self.position(t + h) - 2 * self.position(t) + self.position(t - h)) / h**2
        rates = np.array([0.0, 0.0, (self.yaw(t + h) - self.yaw(t - h)) / (2 * h)]) + rng.normal(0.0, 0.003, 3)
        force = self.pose(t)[:3, :3].T @ (acceleration + GRAVITY) + rng.normal(0.0, 0.05, 3)
        return ImuReading(round(t * NS), rates, force)

    def readings(self, start_s, end_s, rng):
        return [self.reading(t, rng) for t in np.arange(start_s + 0.01, end_s + 0.005, 0.01)]

    def sweep(self, start_s, seed, count=7000):
        """A sweep of 0.1 s; each point is measured from the pose of its own moment."""
        rng = np.random.default_rng(seed)
        points = yard(count, seed, corridor=self._corridor, ground=self._ground)
        times = rng.uniform(0.0, 0.1, len(points))
        knots = [self.pose(start_s + k) for k in np.linspace(0.0, 0.1, 11)]
        seen = np.empty_like(points)
        for k, pose in enumerate(knots):  # to the nearest 10 ms, like a column of beams
            here = np.round(times * 100) == k
            seen[here] = (points[here] - pose[:3, 3]) @ pose[:3, :3]
        times = np.round(times * 100) / 100
        seen += rng.normal(0.0, NOISE_M, seen.shape)
        range_m = np.linalg.norm(seen, axis=1)
        near = (range_m < self._reach_m) & (np.abs(seen[:, 0]) <= self._across * range_m)
        return Sweep(round(start_s * NS), seen[near].astype(np.float32), times[near].astype(np.float32))

    def autopilot(self, end_s, *, drift=0.0, jump_m=0.0, jump_s=np.inf, raised=lambda _t: 0.0, turned=lambda _t: np.zeros(3)):
        """What the autopilot tells of the last sweep's time: the pose, its position wrong by ``drift`` of the way from the start.

        Its height is wrong by ``raised(t)``. Its attitude is wrong by the rotation vector ``turned(t)``, map frame, radians.
        """
        poses = PoseBuffer(keep_s=60.0)
        for t in np.arange(max(0.0, end_s - 0.12), end_s + 0.03, 0.02):  # a sweep's time, and a pose before and after
            pose = self.pose(t)
            start = self.position(0.0)
            given = start + (1.0 + drift) * (pose[:3, 3] - start) + (jump_m if t >= jump_s else 0.0) * np.array([1.0, 0.0, 0.0])
            given[2] += raised(t)
            attitude = Rotation.from_rotvec(turned(t)) * Rotation.from_matrix(pose[:3, :3])
            poses.add(round(t * NS), tuple(given), attitude.as_quat())
        return poses
