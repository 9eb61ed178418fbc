"""Whole turns of a LiDAR whose driver sends parts of them: half turns at 20 Hz, or packets."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from perception_core.poses import NS
from perception_core.sweep import Sweep

SECTORS = 36
SAMPLE = 720
LEAST_SECTORS = 3  # of a part
LEAST_POINTS = 3  # of the sample, in a sector that a part covers
COMMON = 0.34  # of the sectors of the smaller part, at its edges, may be in the other
LONGEST_TURN_S = 0.25
MOST_PARTS = 12


class TurnJoiner:
    """Join sweeps, in their order, that look into different directions; not thread-safe.

    What a sensor that loses sectors still has is where it was: so nothing is joined to it, however few they are.
    """

    def __init__(self) -> None:
        self._parts: deque[tuple[Sweep, NDArray[np.bool_]]] = deque(maxlen=MOST_PARTS)

    def joined(self, sweep: Sweep) -> Sweep:
        """Return the sweep with those just before it that look elsewhere, in the order of time; itself where it covers what they do."""
        covered = _covered(sweep.points)
        parts, seen = [sweep], [covered]
        if np.count_nonzero(covered) >= LEAST_SECTORS:
            for earlier, theirs in reversed(self._parts):
                apart_s = (sweep.stamp_ns - earlier.stamp_ns) / NS
                if not 0.0 < apart_s < LONGEST_TURN_S or any(_overlap(theirs, other) for other in seen):
                    break
                parts.insert(0, earlier)
                seen.append(theirs)
            self._parts.append((sweep, covered))
        if len(parts) == 1:
            return sweep
        times = [part.times_s + np.float32((part.stamp_ns - sweep.stamp_ns) / NS) for part in parts]
        return Sweep(sweep.stamp_ns, np.concatenate([part.points for part in parts]), np.concatenate(times))


def _overlap(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> bool:
    fewest = min(np.count_nonzero(one), np.count_nonzero(other))
    return bool(np.count_nonzero(one & other) > COMMON * fewest)


def _covered(points: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which sectors around the sensor's z axis have returns, (SECTORS,)."""
    sample = points[:: max(1, len(points) // SAMPLE)]
    x, y, z = sample.T
    known = np.isfinite(x) & np.isfinite(y) & ((x != 0.0) | (y != 0.0) | (z != 0.0))
    sector = ((np.arctan2(y[known], x[known]) + np.pi) * (SECTORS / (2.0 * np.pi))).astype(np.intp) % SECTORS
    covered: NDArray[np.bool_] = np.bincount(sector, minlength=SECTORS) >= LEAST_POINTS
    return covered
