"""A map of voxels: each keeps the mean of the points that fell into it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.voxel_index import VoxelIndex

if TYPE_CHECKING:
    from numpy.typing import NDArray

_GROWTH = 2
_FIRST_CAPACITY = 1 << 14
_KEY_LIMIT = 1 << 20


class VoxelMap:
    """Voxels of ``voxel_m``; not thread-safe.

    A voxel costs about 44 bytes (index 16, sum 24, count 4). Memory grows with the surface seen, not with the time flown: a facade of 1000
    square metres takes about 100,000 voxels of 0.1 m for each layer of noise. At ``max_voxels`` new voxels are refused, known ones still
    improve.
    """

    def __init__(self, *, voxel_m: float, max_voxels: int) -> None:
        self.voxel_m = voxel_m
        self._max_voxels = max_voxels
        self._index = VoxelIndex()
        self._sums: NDArray[np.float64] = np.zeros((_FIRST_CAPACITY, 3))
        self._counts: NDArray[np.int32] = np.zeros(_FIRST_CAPACITY, dtype=np.int32)
        self._size = 0

    def __len__(self) -> int:
        return self._size

    @property
    def full(self) -> bool:
        """Whether new voxels are refused."""
        return self._size >= self._max_voxels

    @property
    def points(self) -> NDArray[np.float64]:
        """The means (N, 3), metres, in the order in which the voxels were first seen."""
        means: NDArray[np.float64] = self._sums[: self._size] / self._counts[: self._size, None]
        return means

    @property
    def counts(self) -> NDArray[np.int32]:
        """How many points each voxel has seen, (N,)."""
        return self._counts[: self._size].copy()

    def insert(self, points: NDArray[np.float64]) -> int:
        """Add points (N, 3) and return how many voxels are new; raise ValueError for points that are not finite or beyond 100 km."""
        if not len(points):
            return 0
        keys = np.floor(points / self.voxel_m)
        if not np.all(np.abs(keys) < _KEY_LIMIT):
            raise ValueError(f"a point is not finite or farther than {_KEY_LIMIT * self.voxel_m:.0f} m from the map's origin")
        unique, sums, counts = _by_voxel(keys.astype(np.int32), points)
        slots, new = self._slots(unique)
        kept = slots >= 0
        self._sums[slots[kept]] += sums[kept]
        self._counts[slots[kept]] += counts[kept]
        return new

    def _slots(self, keys: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
        """Return the row of each key, -1 where the map is full, and the number of new rows; the keys are in order."""
        slots = self._index.rows(keys)
        missing = np.flatnonzero(slots < 0)[: self._max_voxels - self._size]
        if len(missing):
            slots[missing] = np.arange(self._size, self._size + len(missing))
            self._index.put(keys[missing], slots[missing])
            self._size += len(missing)
            self._reserve()
        return slots, len(missing)

    def _reserve(self) -> None:
        if self._size > len(self._counts):
            rows = max(_GROWTH * len(self._counts), self._size)
            sums, counts = self._sums, self._counts
            self._sums, self._counts = np.zeros((rows, 3)), np.zeros(rows, dtype=np.int32)  # what is not used takes no memory yet
            self._sums[: len(sums)], self._counts[: len(counts)] = sums, counts


def _by_voxel(keys: NDArray[np.int32], points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Return the distinct keys (M,), packed and in order, and the sum (M, 3) and the number (M,) of the points of each."""
    unique, inverse, counts = np.unique(_packed(keys), return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(inverse, weights=points[:, axis], minlength=len(unique)) for axis in range(3)], axis=1, dtype=np.float64)
    return unique, sums, counts.astype(np.int64)


def _packed(keys: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return one number (N,) for each voxel (N, 3)."""
    return (keys[:, 0].astype(np.int64) + _KEY_LIMIT) << 42 | (keys[:, 1].astype(np.int64) + _KEY_LIMIT) << 21 | (keys[:, 2] + _KEY_LIMIT)


def in_voxels_of(points: NDArray[np.float64], others: NDArray[np.float64], voxel_m: float) -> NDArray[np.bool_]:
    """Return which of the points (N, 3) share a voxel with one of the others (M, 3)."""
    keys, known = (_packed(np.floor(each / voxel_m).astype(np.int32)) for each in (points, others))
    known.sort()
    order = np.argsort(keys)  # keys in order are found several times as fast
    place = np.minimum(np.searchsorted(known, keys[order]), max(len(known) - 1, 0))
    found: NDArray[np.bool_] = np.zeros(len(points), dtype=np.bool_)
    found[order] = known[place] == keys[order] if len(known) else False
    return found


def downsample(points: NDArray[np.float64], voxel_m: float) -> NDArray[np.float64]:
    """Return the mean of the points in each voxel, (M, 3)."""
    if not len(points):
        return points
    _, sums, counts = _by_voxel(np.floor(points / voxel_m).astype(np.int32), points)
    means: NDArray[np.float64] = sums / counts[:, None]
    return means
