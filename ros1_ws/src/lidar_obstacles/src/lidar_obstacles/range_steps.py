"""Did all ranges become longer, or all shorter, from one sweep to the next? No motion among surfaces does that, an error of the sensor may.

A vehicle that moves comes nearer to what is ahead of it and farther from what is behind. Where it has surfaces on one side only, as over
open ground, the nearest one comes or goes at the vehicle's speed at most. So a step of most ranges, the shortest included, that is faster
than the vehicle is the sensor's. A constant error that is there from the start, or that grows slowly, can't be told by this: a sweep of a
larger room looks the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from perception_core import NS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Floats32 = NDArray[np.float32]

AROUND, UP = 36, 18  # cells of 10 degrees
CELL_RETURNS = 5
CELLS = 8  # that both sweeps have returns in; with fewer nothing is said
LONGEST_PAUSE_S = 1.0  # after which sweeps aren't compared, and an error that was found is forgotten: the sensor was started again
TURN_S = 0.11  # so far back a sweep is held against earlier ones: where parts of turns are joined, an error comes in parts, too
QUARTILES = (25.0, 75.0)
NEAREST = 10.0  # percent of the cells
FEW = 1.0  # percent of the returns: specks of dust or rain
ALIKE_M = 0.3  # by which the changes of an error may differ over the view, with the vehicle's own motion
LEAST_HEIGHT_M = 1.0  # above the ground, or from another surface that is all there is to see
STEP_M = 0.15  # that hovering may make of most ranges, with the vehicle's own tilting
OBLIQUE = 1.2  # by which the range along a ray changes faster than the distance of a surface that the ray meets at 56 degrees


@dataclass(frozen=True)
class Seen:
    """Points by direction around the sensor's z axis and its sine above the others, (N,) each, and by range."""

    azimuth_rad: Floats32
    sine_up: Floats32
    ranges_m: Floats32

    @classmethod
    def of(cls, points: Floats32, ranges_m: Floats32) -> Seen:
        """Return those of the points (3, N) that are finite."""
        known = np.isfinite(ranges_m)
        if not known.all():
            points, ranges_m = points[:, known], ranges_m[known]
        x, y, z = points
        return cls(np.arctan2(y, x), z / np.maximum(ranges_m, np.float32(1e-6)), ranges_m)

    def mean_ranges(self, turned_rad: float = 0.0) -> Floats:
        """Return the mean range in each cell of directions, (AROUND * UP,), NaN where returns are few.

        The cells are those of a sensor that has not turned by ``turned_rad`` about its z axis.
        """
        around = (self.azimuth_rad + np.float32(np.pi + turned_rad % (2.0 * np.pi))) * np.float32(AROUND / (2.0 * np.pi))
        up = (np.arcsin(np.clip(self.sine_up, -1.0, 1.0)) + np.float32(np.pi / 2.0)) * np.float32(UP / np.pi)
        cell = around.astype(np.int32) % AROUND * UP + np.minimum(up.astype(np.int32), UP - 1)
        counts = np.bincount(cell, minlength=AROUND * UP)
        sums = np.bincount(cell, weights=self.ranges_m, minlength=AROUND * UP)
        return np.where(counts >= CELL_RETURNS, sums / np.maximum(counts, 1), np.nan)

    def select(self, mask: NDArray[np.bool_]) -> Seen:
        """Return the points where the mask (N,) is true."""
        return self if mask.all() else Seen(self.azimuth_rad[mask], self.sine_up[mask], self.ranges_m[mask])


class RangeSteps:
    """Compare sweeps in their order, and remember the error that they began with; not thread-safe."""

    def __init__(self, max_speed_m_s: float) -> None:
        self._max_speed_m_s = max_speed_m_s
        self._before: list[tuple[int, Floats, Floats | None]] = []
        self._offset_m = 0.0

    def offset_m(self, cells_m: Floats, stamp_ns: int, *, clear: bool, position_m: Floats | None = None) -> float:
        """Return by how much the ranges are too long; 0 where no step was seen, or it was taken back.

        ``cells_m``: as of `Seen.mean_ranges`. Where the view is not ``clear``, as on the ground, the sensor may not see the very nearest,
        and small motions change all ranges along the rays by much: nothing new is found there. By the vehicle's position (3,) where it
        is known, else by its speed at most, ranges may change.
        """
        now = cells_m
        if np.count_nonzero(np.isfinite(now)) < CELLS:
            return self._offset_m
        at_once = (stamp_ns, now, position_m)
        last_ns = self._before[-1][0] if self._before else stamp_ns
        if not 0 < stamp_ns - last_ns <= LONGEST_PAUSE_S * NS:
            self._offset_m, self._before = 0.0, [at_once]
            return 0.0
        before = [each for each in self._before if each[0] == last_ns or stamp_ns - each[0] <= TURN_S * NS]
        self._before = [*before, at_once]
        for then_ns, then, then_m in reversed(before):
            limit_m = OBLIQUE * self._max_speed_m_s * (stamp_ns - then_ns) / NS
            if position_m is not None and then_m is not None:
                limit_m = min(limit_m, OBLIQUE * float(np.linalg.norm(position_m - then_m)) + STEP_M)
            step_m = _step(then, now, most_share=limit_m / LEAST_HEIGHT_M)
            if abs(step_m) > limit_m and clear:
                offset_m = self._offset_m + step_m
                self._offset_m, self._before = offset_m if abs(offset_m) > limit_m / 2.0 else 0.0, [at_once]
                break
        return self._offset_m


def _step(before_m: Floats, now_m: Floats, *, most_share: float) -> float:
    """Return by how much three quarters of the ranges and half of the nearest ones grew at least; negative: shrank; 0 if neither.

    An error of the sensor adds the same to all, or multiplies them by more than a share of ``most_share``. A climb over open ground, seen
    by beams that are nearly level, multiplies them by less.
    """
    both = np.isfinite(before_m) & np.isfinite(now_m)
    if np.count_nonzero(both) < CELLS:
        return 0.0
    before_m, now_m = before_m[both], now_m[both]
    change_m = now_m - before_m
    of_nearest_m = float(np.median(change_m[before_m <= np.percentile(before_m, NEAREST)]))
    low_m, high_m = (float(value) for value in np.percentile(change_m, QUARTILES))
    step_m = max(0.0, min(low_m, of_nearest_m)) + min(0.0, max(high_m, of_nearest_m))
    low, high = (float(value) for value in np.percentile(change_m / before_m, QUARTILES))
    alike = high_m - low_m <= max(abs(step_m), ALIKE_M)
    return step_m if alike or max(low, -high) > most_share else 0.0
