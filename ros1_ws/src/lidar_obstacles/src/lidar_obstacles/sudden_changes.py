"""Does a LiDAR see its surroundings elsewhere from one sweep to the next, by more than the vehicle's motion makes of them?

The view is cut into cells of directions that stand still while the sensor turns about its z axis. From one sweep to the next a vehicle
comes to see few of them anew. A sensor that is suddenly turned, mirrored or moved, whose sweeps are suddenly older, or whose ranges are
others, sees most of them anew. What it saw before the change is remembered until it is seen again. Farther away than that can be told by
the view, walls and posts tell it (`MountCheck.hold`); where too few of them are in view, or the vehicle stays where it is and sees the
same, nothing more can be found of the sensor: it is unknown.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lidar_obstacles.range_steps import CELLS, LEAST_HEIGHT_M
from perception_core import FINE, NS, FaultKind, Finding, broken, unsure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

CHANGED_M = 0.6  # of the mean range of a cell, beside what the vehicle's motion may make of it
MOST_CHANGED = 0.3  # of the cells; good sweeps have 0.18 at most
ABOVE_USUAL = 2.5  # times what lately was usual: among trees more changes than in a street
LATELY = 10  # sweeps of which the usual share is known
KNOWN = 3  # of them are enough
LONGEST_STEP_S, LONGEST_STEP_M, LONGEST_TILT_RAD = 0.3, 0.5, np.radians(1.5)  # between two sweeps that are compared
BACK_M = 2.0  # from the place of a change, so far a second one may be the way back
REST_S, REST_M = 10.0, 0.3  # of a vehicle that stays where it is after a change
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
        self._apart = False
        self._resting: _View | None = None  # the first sweep, after a change, of where the vehicle is now
        self._rested_s = 0.0

    @property
    def finding(self) -> Finding:
        """The finding by the sweeps so far."""
        if self._before is None:
            return FINE
        told = f"{self._changed_share:.0%} of the view changed by more than {CHANGED_M:g} m from one sweep to the next"
        if self._apart:
            return unsure(FaultKind.RANGE, f"{told}, and too little is in view that was before", *CHANGES)
        if self._rested_s >= REST_S:
            return unsure(FaultKind.RANGE, f"{told}, and nothing moves since by which it could be judged", *CHANGES)
        return broken(FaultKind.RANGE, told, *CHANGES)

    def take(self, cells_m: Floats, stamp_ns: int, *, position_m: Floats | None, tilted_rad: float, clear: bool) -> None:
        """Judge a sweep by the one before it; while the vehicle's position (3,) is None, it is not judged.

        ``cells_m``: as of `Seen.mean_ranges`; ``tilted_rad``: by how much the sensor's z axis has turned since the sweep before. Where the
        view is not ``clear``, as on the ground, it only tells whether the vehicle is at rest.
        """
        last, self._last = self._last, None
        if position_m is None:
            return
        now = _View(stamp_ns, position_m, cells_m)
        if clear:
            self._last = now
            if self._before is not None and _ended(now, last, self._before):
                self.forget()
            elif self._before is None and last is not None and abs(tilted_rad) <= LONGEST_TILT_RAD:
                self._compare(last, now)
        self._rest(now)

    def part(self, *, apart: bool) -> None:
        """Store whether the vehicle is where too little is in view that was before the change: the change can't be judged there."""
        self._apart = apart

    def forget(self) -> None:
        """Forget a change: what was judged good is back."""
        self._before = self._resting = None
        self._usual.clear()

    def _rest(self, now: _View) -> None:
        """Find how long, after a change, the vehicle has been where it is, and has seen the same."""
        then = self._resting
        if self._before is None or then is None or not _same(then, now):
            self._resting = then = now
        self._rested_s = (now.stamp_ns - then.stamp_ns) / NS

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
    """Return whether all is again as it was before a change, or the clock went back: the flight has begun anew."""
    away_m = float(np.linalg.norm(now.position_m - before.position_m))
    if now.stamp_ns < before.stamp_ns:
        return True
    share = _share_changed(before, now)
    if share is None or share >= MOST_CHANGED / 2.0:
        return False
    if away_m <= LONGEST_STEP_M:
        return True
    back = None if last is None or away_m > BACK_M else _share_changed(last, now)
    return back is not None and back > MOST_CHANGED


def _same(then: _View, now: _View) -> bool:
    """Return whether the vehicle is where it was, and sees what it saw."""
    if now.stamp_ns < then.stamp_ns or np.linalg.norm(now.position_m - then.position_m) > REST_M:
        return False
    share = _share_changed(then, now)
    return share is not None and share < MOST_CHANGED / 2.0


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
