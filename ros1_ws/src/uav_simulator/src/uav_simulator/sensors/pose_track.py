"""The vehicle's recent poses, to know where it was at any moment of a LiDAR's sweep."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_simulator.frames import Quat, Vec3

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """T_map_body at a moment: simulated seconds, metres, unit quaternion (w x y z)."""

    stamp_s: float
    position: Vec3
    attitude: Quat


class PoseTrack:
    """Keeps the poses of the last fraction of a second, one each 20 ms."""

    def __init__(self, length: int = 16) -> None:
        self._poses: deque[Pose] = deque(maxlen=length)

    def add(self, pose: Pose) -> None:
        """Append a pose, later than the others."""
        self._poses.append(pose)

    def at(self, stamps_s: Floats) -> tuple[Floats, Floats]:
        """Return positions (N, 3) and rotation matrices R_map_body (N, 3, 3), interpolated; clamped at the ends."""
        times = np.array([p.stamp_s for p in self._poses])
        positions = np.array([p.position for p in self._poses])
        quats = np.array([p.attitude for p in self._poses])
        # q and -q are the same attitude: take the signs that make neighbours alike before interpolating.
        flips = np.where(np.einsum("ij,ij->i", quats[1:], quats[:-1]) < 0.0, -1.0, 1.0)
        quats[1:] *= np.cumprod(flips)[:, None]
        position = np.stack([np.interp(stamps_s, times, positions[:, k]) for k in range(3)], axis=1)
        quat = np.stack([np.interp(stamps_s, times, quats[:, k]) for k in range(4)], axis=1)
        return position, _matrices(quat / np.linalg.norm(quat, axis=1, keepdims=True))


def _matrices(quats: Floats) -> Floats:
    w, x, y, z = quats.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
