"""What was seen from where: the clouds of stretches of the flight, each in its keyframe's frame, so that it can be moved later."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.surface import PATCH_M, Patches, Surface, flat_patches, join
from lidar_mapping.voxel_map import downsample, in_voxels_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NEIGHBOUR_KEYFRAMES = 3
DENSE_POINTS = 40_000  # a keyframe of so many tells planes by itself: of 64 beams it has more, of 16 beams fewer
MOST_CENTRES = 15_000  # of patches in a keyframe: of 16 beams it has fewer; with 5,000 of 64 beams the heading drifts along a street
MOST_KEPT = 1_500_000  # points in all keyframes (18 MB), until those behind keep only what the next one does not hold


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
    """All keyframes in the order of time.

    A keyframe of a sensor of 16 beams costs about 300 kB. Beyond `MOST_KEPT` points, those that lie behind are thinned, oldest first: each
    place is kept with the last keyframe that saw it. So what memory there is grows with the surface seen, and a limit bounds it.
    """

    def __init__(self, *, voxel_m: float, limit: int) -> None:
        self._voxel_m, self._limit = voxel_m, limit
        self.all: list[Keyframe] = []
        self._thinned = 0  # how many of the oldest

    @property
    def full(self) -> bool:
        """Whether no more are taken."""
        return len(self.all) >= self._limit

    def add(self, stamp_ns: int, pose: Floats, points: Floats) -> Keyframe:
        """Take the points (N, 3), map frame, of the sweeps since the last keyframe.

        Where they are few, the planes are found with the help of the last keyframes.
        """
        fresh = downsample(points, self._voxel_m)
        dense = len(fresh) > DENSE_POINTS
        around = np.vstack([fresh, *(frame.points_in_map() for frame in ([] if dense else self.all[-NEIGHBOUR_KEYFRAMES:]))])
        back: Floats = np.asarray(np.linalg.inv(pose), dtype=np.float64)
        thinned = downsample(around, PATCH_M)
        centres = thinned if dense else downsample(fresh, PATCH_M)
        patches = flat_patches(centres[:: len(centres) // MOST_CENTRES + 1], thinned).moved(back)
        inside = (fresh @ back[:3, :3].T + back[:3, 3]).astype(np.float32)
        frame = Keyframe(stamp_ns, pose, inside, patches)
        self.all.append(frame)
        self._bound()
        return frame

    def _bound(self) -> None:
        """Thin the oldest keyframes that are not, until there are few enough points or only the last ones are left."""
        kept = sum(len(frame.points) for frame in self.all)
        while kept > MOST_KEPT and self._thinned < len(self.all) - NEIGHBOUR_KEYFRAMES:
            frame, following = self.all[self._thinned : self._thinned + 2]
            self._thinned += 1
            if not frame.everywhere:
                kept -= len(frame.points)
                frame.points = frame.points[~in_voxels_of(frame.points_in_map(), following.points_in_map(), PATCH_M)]
                kept += len(frame.points)

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
