"""Where the ground is: the highest surface below all returns that nowhere rises more steeply than a slope.

Of each cell of a grid around the way ahead the lowest return is taken. Over these the ground is the lower envelope of cones: what rises
more steeply than ``slope_deg`` is cut off and stands on the ground (a morphological erosion by a cone, as in Vosselman's slope-based
filter). Where no ground was seen at all, as before a cable or a branch in the air, the ground last seen below the vehicle bounds it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CELL_M = 0.5
BEHIND_M = 4.0
ASIDE_M = 5.0
UNDER_VEHICLE_M = 4.0
GHOST_M = 0.5  # returns that are lower than their neighbourhood by this are reflections seen below the ground
WINDOW = 5


@dataclass(frozen=True)
class GroundSettings:
    """``slope_deg``: the steepest ground; what is steeper is an obstacle."""

    slope_deg: float = 10.0
    length_m: float = 12.0


class GroundModel:
    """Estimates the height of points above the ground; remembers where the ground was last seen near the vehicle. Not thread-safe."""

    def __init__(self, settings: GroundSettings) -> None:
        self._rise = float(np.tan(np.radians(settings.slope_deg)))
        self._shape = (int((BEHIND_M + settings.length_m) / CELL_M) + 1, int(2 * ASIDE_M / CELL_M))
        ahead, left = np.meshgrid(*(np.arange(count) + 0.5 for count in self._shape), indexing="ij")
        self._centres = np.stack([ahead * CELL_M - BEHIND_M, left * CELL_M - ASIDE_M], axis=-1).reshape(-1, 2)
        offsets = self._centres[:, None] - self._centres[None]
        # A tenth of a millimetre is enough, and half the bytes are moved: this is added to all cells, a sweep.
        self._cones = (self._rise * np.hypot(offsets[..., 0], offsets[..., 1])).astype(np.float32)
        self._near = np.hypot(self._centres[:, 0], self._centres[:, 1]) <= UNDER_VEHICLE_M
        self._seen_at_enu_m: Floats | None = None  # where and how high the ground was last seen near the vehicle

    def heights(self, seen: NDArray[np.floating], wanted: NDArray[np.intp], origin_enu_m: Floats, direction: Floats) -> Floats:
        """Return the height above the ground of the points with these numbers, metres; infinite outside of the grid.

        ``seen`` (N, 3) are all points' corridor coordinates from ``origin_enu_m``, the vehicle's centre, along ``direction``.
        """
        row, column = (np.floor((seen[:, axis] + below_m) / CELL_M) for axis, below_m in enumerate((BEHIND_M, ASIDE_M)))
        inside = (row >= 0) & (row < self._shape[0]) & (column >= 0) & (column < self._shape[1])
        flat = np.where(inside, row * self._shape[1] + column, -1.0).astype(np.intp)
        up_m = seen[:, 2] + origin_enu_m[2]
        known = np.flatnonzero(inside)
        lowest: Floats = np.full(self._shape[0] * self._shape[1], np.inf)
        np.minimum.at(lowest, flat.take(known), up_m.take(known))
        lowest = _without_ghosts(lowest, self._shape)
        of_wanted = flat.take(wanted)
        cells, cell = np.unique(of_wanted, return_inverse=True)
        ground = np.minimum(self._envelope(lowest, cells), self._remembered(cells, origin_enu_m, direction))
        self._remember(lowest, origin_enu_m, direction)
        return np.where(of_wanted < 0, np.inf, up_m.take(wanted) - ground.take(cell))

    def _envelope(self, lowest: Floats, cells: NDArray[np.intp]) -> Floats:
        """Return how high the ground of these cells can be by the lowest returns of all, (N,)."""
        seen = np.flatnonzero(np.isfinite(lowest))
        cones = self._cones.take(cells, axis=0).take(seen, axis=1)
        cones += lowest.take(seen).astype(np.float32)
        envelope: Floats = np.min(cones, axis=1, initial=np.inf).astype(np.float64)
        return envelope

    def _remembered(self, cells: NDArray[np.intp], origin: Floats, direction: Floats) -> Floats:
        """Return how high it can be by what was seen near the vehicle before, (N,); at first the ground of the take-off is at 0."""
        if self._seen_at_enu_m is None:
            self._seen_at_enu_m = np.array([origin[0], origin[1], 0.0])
        offset = self._seen_at_enu_m[:2] - origin[:2]
        at = np.array([offset @ direction[:2], offset @ np.array([-direction[1], direction[0]])])
        bound: Floats = self._seen_at_enu_m[2] + self._rise * np.hypot(*(self._centres.take(cells, axis=0) - at).T)
        return bound

    def _remember(self, lowest: Floats, origin: Floats, direction: Floats) -> None:
        near = np.where(self._near, lowest, np.inf)
        best = int(np.argmin(near))
        if np.isfinite(near[best]):
            ahead, left = self._centres[best]
            place = origin[:2] + ahead * direction[:2] + left * np.array([-direction[1], direction[0]])
            self._seen_at_enu_m = np.array([place[0], place[1], near[best]])


def _without_ghosts(lowest: Floats, shape: tuple[int, int]) -> Floats:
    """Raise cells that are far below the middle of their neighbours to that."""
    half = WINDOW // 2
    seen = np.flatnonzero(np.isfinite(lowest))
    grid = np.pad(np.where(np.isfinite(lowest), lowest, np.nan).reshape(shape), half, constant_values=np.nan)
    of_all = np.lib.stride_tricks.sliding_window_view(grid, (WINDOW, WINDOW)).reshape(len(lowest), -1)
    windows = np.sort(of_all.take(seen, axis=0), axis=1)
    count = np.sum(np.isfinite(windows), axis=1)
    middle = windows[np.arange(len(seen)), (count - 1) // 2]  # NaN is sorted to the end
    raised = lowest.copy()
    raised[seen] = np.where(lowest[seen] < middle - GHOST_M, middle, lowest[seen])
    return raised
