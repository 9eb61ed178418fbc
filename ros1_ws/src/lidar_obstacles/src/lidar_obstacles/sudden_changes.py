"""Does a LiDAR see its surroundings elsewhere from one sweep to the next, by more than the vehicle's motion makes of them?

The view is cut into cells of directions that stand still while the sensor turns about its z axis. From one sweep to the next a vehicle
comes to see few of them anew. A sensor that is suddenly turned, mirrored or moved, whose sweeps are suddenly older, or whose ranges are
others, sees most of them anew. What it saw before the change is remembered until it is seen again, or the vehicle has gone away.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lidar_obstacles.range_steps import CELLS, LEAST_HEIGHT_M, mean_ranges
from perception_core import FINE, NS, FaultKind, Finding, broken

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from lidar_obstacles.range_steps import Seen

    Floats = NDArray[np.float64]

CHANGED_M = 0.6  # of the mean range of a cell, beside what the vehicle's motion may make of it
MOST_CHANGED = 0.3  # of the cells; good sweeps have 0.18 at most
ABOVE_USUAL = 2.5  # times what lately was usual: among trees more changes than in a street
LATELY = 10  # sweeps of which the usual share is known
KNOWN = 3  # of them are enough
LONGEST_STEP_S, LONGEST_STEP_M, LONGEST_TILT_RAD = 0.3, 0.5, np.radians(1.5)  # between two sweeps that are compared
BACK_M = 2.0  # from the place of a change, so far a second one may be the way back
LEFT_BEHIND_M, FORGOTTEN_S = 5.0, 20.0  # from the place and moment of a change, after which the sensor is judged anew
CHANGES = "its mount, or the axes of its driver, are other ones than before", "the ranges are wrong, or old"


@dataclass(frozen=True)
class _View:
    """One sweep: moment, position of the vehicle (3,), and the mean range in each cell, NaN where returns are few."""

    stamp_ns: int
    position_m: Floats
    ranges_m: Floats


class SuddenChange:
    """Judge sweeps in their order; not thread-safe."""

    def __init__(self) -> None:
        self._last: _View | None = None
        self._usual: deque[float] = deque(maxlen=LATELY)
        self._before: _View | None = None  # the last sweep before the change, as long as there is one
        self._changed_share = 0.0

    def finding(self, seen: Seen, stamp_ns: int, *, position_m: Floats | None, turned_rad: float, tilted_rad: float) -> Finding:
        """Return what a sweep tells by the one before it; nothing new while the vehicle's position (3,) is not known.

        ``turned_rad``: by how much the sensor has turned about its z axis since it was started; ``tilted_rad``: by how much that axis has
        turned since the sweep before.
        """
        last, self._last = self._last, None
        if position_m is not None:
            now = self._last = _View(stamp_ns, position_m, mean_ranges(seen, turned_rad))
            if self._before is not None and _ended(now, last, self._before):
                self._before = None
                self._usual.clear()
            elif self._before is None and last is not None and abs(tilted_rad) <= LONGEST_TILT_RAD:
                self._compare(last, now)
        if self._before is None:
            return FINE
        told = f"{self._changed_share:.0%} of the view changed by more than {CHANGED_M:g} m from one sweep to the next"
        return broken(FaultKind.RANGE, told, *CHANGES)

    def _compare(self, last: _View, now: _View) -> None:
        far = np.linalg.norm(now.position_m - last.position_m) > LONGEST_STEP_M
        share = None if far or not 0 < now.stamp_ns - last.stamp_ns <= LONGEST_STEP_S * NS else _share_changed(last, now)
        if share is None:
            return
        if len(self._usual) >= KNOWN and share > max(MOST_CHANGED, ABOVE_USUAL * float(np.median(self._usual))):
            self._before, self._changed_share = last, share
        else:
            self._usual.append(share)


def _ended(now: _View, last: _View | None, before: _View) -> bool:
    """Return whether all is again as it was before a change, or that was far away or long ago."""
    away_m = float(np.linalg.norm(now.position_m - before.position_m))
    if away_m > LEFT_BEHIND_M or not 0 <= now.stamp_ns - before.stamp_ns <= FORGOTTEN_S * NS:
        return True
    share = _share_changed(before, now)
    if share is None or share >= MOST_CHANGED / 2.0:
        return False
    if away_m <= LONGEST_STEP_M:
        return True
    back = None if last is None or away_m > BACK_M else _share_changed(last, now)
    return back is not None and back > MOST_CHANGED


def _both(then: _View, now: _View) -> tuple[Floats, Floats] | None:
    """Return the mean ranges in the cells that both have, or None where these are few."""
    both = np.isfinite(then.ranges_m) & np.isfinite(now.ranges_m)
    return (then.ranges_m[both], now.ranges_m[both]) if np.count_nonzero(both) >= CELLS else None


def _share_changed(then: _View, now: _View) -> float | None:
    """Return the share of the cells that changed by more than the vehicle's motion makes of them; a climb multiplies ranges."""
    both = _both(then, now)
    if both is None:
        return None
    moved = now.position_m - then.position_m
    borne_m = CHANGED_M + float(np.linalg.norm(moved[:2])) + np.minimum(*both) * abs(float(moved[2])) / LEAST_HEIGHT_M
    return float(np.mean(np.abs(both[1] - both[0]) > borne_m))
