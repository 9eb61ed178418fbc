"""What was seen from where: the clouds of stretches of the flight, each in its keyframe's frame, so that it can be moved later."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.seen import HeldSeen, SeenFile, StoredSeen
from lidar_mapping.surface import PATCH_M, Surface, flat_patches, join
from lidar_mapping.voxel_map import downsample, in_voxels_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from lidar_mapping.surface import Patches

    Floats = NDArray[np.float64]

NEIGHBOUR_KEYFRAMES = 3
DENSE_POINTS = 40_000  # a keyframe of so many tells planes by itself: of 64 beams it has more, of 16 beams fewer
MOST_CENTRES = 15_000  # of patches in a keyframe: of 16 beams it has fewer; with 5,000 of 64 beams the heading drifts along a street
MOST_KEPT = 1_500_000  # points in all keyframes, until those behind keep only what the next one does not hold
MOST_HELD = 1 << 24  # bytes of keyframes in memory: about 50 of 16 beams, 30 m of flight, so that a flight seldom reads what it needs


@dataclass
class Keyframe:
    """``pose`` is T_map_base (4, 4); what was ``seen`` is in the keyframe's base frame.

    A keyframe that is a whole map was seen from ``everywhere``.
    """

    stamp_ns: int
    pose: Floats
    seen: HeldSeen | StoredSeen
    everywhere: bool = False

    def points_in_map(self) -> Floats:
        """Return the points where the pose puts them, (N, 3)."""
        return self.placed(self.seen.points)

    def placed(self, points: NDArray[np.float32]) -> Floats:
        """Return points (N, 3) of the base frame where the pose puts them."""
        in_map: Floats = points @ self.pose[:3, :3].T + self.pose[:3, 3]
        return in_map

    def patches_in_map(self) -> Patches:
        """Return the patches where the pose puts them."""
        return self.seen.patches.moved(self.pose)


class Keyframes:
    """All keyframes in the order of time.

    A keyframe of a sensor of 16 beams takes about 300 kB. Beyond `MOST_KEPT` points, those that lie behind are thinned, oldest first: each
    place is kept with the last keyframe that saw it. Beyond `MOST_HELD` bytes they go to a file in ``folder``, oldest first, and are read
    back where the vehicle comes by again or the map is built anew. So memory does not grow with the way; the file does, and a limit bounds
    it. What can't be written stays in memory, and ``problem`` says so.
    """

    def __init__(self, *, voxel_m: float, limit: int, folder: Path | None = None) -> None:
        self._voxel_m, self._limit = voxel_m, limit
        self.all: list[Keyframe] = []
        self._thinned = 0  # how many of the oldest
        self._file = SeenFile(folder)

    @property
    def problem(self) -> str:
        """What has failed last with the file, and what that means; empty as long as nothing has."""
        return self._file.problem

    @property
    def nbytes(self) -> int:
        """How many bytes of what keyframes saw are in memory, but for a whole map."""
        return sum(frame.seen.nbytes for frame in self.all if isinstance(frame.seen, HeldSeen) and not frame.everywhere)

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
        frame = Keyframe(stamp_ns, pose, HeldSeen(inside, patches))
        self.all.append(frame)
        self._thin()
        self._store()
        return frame

    def _thin(self) -> None:
        """Thin the oldest keyframes that are not, until there are few enough points or only the last ones are left."""
        kept = sum(frame.seen.count for frame in self.all)
        while kept > MOST_KEPT and self._thinned < len(self.all) - NEIGHBOUR_KEYFRAMES:
            frame, following = self.all[self._thinned : self._thinned + 2]
            self._thinned += 1
            if not frame.everywhere:
                seen, points = frame.seen, frame.seen.points
                known = in_voxels_of(frame.placed(points), following.points_in_map(), PATCH_M)
                thinned = HeldSeen(points[~known], seen.patches)
                kept += thinned.count - seen.count
                frame.seen = self._file.put(thinned, at=seen.offset) if isinstance(seen, StoredSeen) else thinned

    def _store(self) -> None:
        """Write the oldest keyframes that are in memory to the file, until few enough bytes are held or only the last ones are left."""
        nbytes = self.nbytes
        for frame in self.all[:-NEIGHBOUR_KEYFRAMES]:
            if nbytes <= MOST_HELD:
                return
            if isinstance(frame.seen, HeldSeen) and not frame.everywhere:
                before, frame.seen = frame.seen, self._file.put(frame.seen)
                if frame.seen is before:
                    return  # the next keyframe tries again
                nbytes -= before.nbytes

    def adopt(self, points: Floats, patches: Patches) -> None:
        """Take what an earlier run saw, map frame, as the first keyframe; its pose stays what it is."""
        self.all.append(Keyframe(0, np.eye(4), HeldSeen(points.astype(np.float32), patches), everywhere=True))

    def surface(self, position: Floats, reach_m: float, *, among: slice | None = None) -> Surface | None:
        """Return the patches of all keyframes (or those ``among``) within reach; None when there are none."""
        near = [
            frame for frame in self.all[among or slice(None)] if frame.everywhere or np.linalg.norm(frame.pose[:3, 3] - position) < reach_m
        ]
        patches = join([frame.patches_in_map() for frame in near])
        return Surface(patches) if len(patches.points) else None
