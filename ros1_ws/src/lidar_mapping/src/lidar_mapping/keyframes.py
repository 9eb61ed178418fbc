"""What was seen from where: the clouds of stretches of the flight, each in its keyframe's frame, so that it can be moved later."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.surface import PATCH_M, Patches, Surface, flat_patches, join
from lidar_mapping.voxel_map import downsample

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NEIGHBOUR_KEYFRAMES = 3
MOST_CENTRES = 15_000  # of patches: a LiDAR of 16 beams has fewer in a keyframe; to tell more planes takes longer than a sweep


@dataclass
class Keyframe:
    """``pose`` is T_map_base (4, 4); ``points`` (N, 3) float32 and ``patches`` are in the keyframe's base frame.

    A keyframe that is a whole map was seen from ``everywhere``.
    """

    stamp_ns: int
    pose: Floats
    points: NDArray[np.float32]
    patches: Patches
    everywhere: bool = False

    def points_in_map(self) -> Floats:
        """Return the points where the pose puts them."""
        placed: Floats = self.points @ self.pose[:3, :3].T + self.pose[:3, 3]
        return placed


class Keyframes:
    """All keyframes in the order of time; a keyframe costs about 300 kB, so a limit bounds the memory."""

    def __init__(self, *, voxel_m: float, limit: int) -> None:
        self._voxel_m, self._limit = voxel_m, limit
        self.all: list[Keyframe] = []

    @property
    def full(self) -> bool:
        """Whether no more are taken."""
        return len(self.all) >= self._limit

    def add(self, stamp_ns: int, pose: Floats, points: Floats) -> Keyframe:
        """Take the points (N, 3), map frame, of the sweeps since the last keyframe; the planes are found with the help of the last ones."""
        fresh = downsample(points, self._voxel_m)
        around = np.vstack([fresh, *(frame.points_in_map() for frame in self.all[-NEIGHBOUR_KEYFRAMES:])])
        back: Floats = np.asarray(np.linalg.inv(pose), dtype=np.float64)
        centres = downsample(fresh, PATCH_M)
        patches = flat_patches(centres[:: len(centres) // MOST_CENTRES + 1], downsample(around, PATCH_M)).moved(back)
        inside = (fresh @ back[:3, :3].T + back[:3, 3]).astype(np.float32)
        frame = Keyframe(stamp_ns, pose, inside, patches)
        self.all.append(frame)
        return frame

    def adopt(self, points: Floats, patches: Patches) -> None:
        """Take what an earlier run saw, map frame, as the first keyframe; its pose stays what it is."""
        self.all.append(Keyframe(0, np.eye(4), points.astype(np.float32), patches, everywhere=True))

    def surface(self, position: Floats, reach_m: float, *, among: slice | None = None) -> Surface | None:
        """Return the patches of all keyframes (or those ``among``) within reach; None when there are none."""
        near = [
            frame for frame in self.all[among or slice(None)] if frame.everywhere or np.linalg.norm(frame.pose[:3, 3] - position) < reach_m
        ]
        patches = join([frame.patches.moved(frame.pose) for frame in near])
        return Surface(patches) if len(patches.points) else None
