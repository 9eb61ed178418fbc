"""Did all returns nearer than some range, or all beyond one, go from one sweep to the next? A wrong gate of the sensor takes them.

A vehicle that moves loses what is near, or what is far, gradually, and its ranges change by its motion: where there were returns nearer
than r, there are some nearer than r and a bit. So what a sensor has that lost its near returns begins much farther away than before.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Edges = NDArray[np.floating[Any]]
    Ranges = NDArray[np.float32]

GATES_M: Final = np.geomspace(2.0, 50.0, 24, dtype=np.float64)
LEAST_HEIGHT_M = 1.0  # above the ground: a climb multiplies the ranges of all rays that meet it
STEP_M = 0.25  # by which ranges change where the vehicle only sways
RECENT = 3  # sweeps
LEAST_NEAR, LEAST_FAR = 0.1, 0.15  # of the returns that were there, to be missed: of 16 rings one may go at once behind a hedge
LOST = 0.3  # of them that are left


class RangeGates:
    """Count returns by range, sweep by sweep, in their order; not thread-safe."""

    def __init__(self) -> None:
        self._recent: deque[Floats] = deque(maxlen=RECENT)
        self._lost: tuple[int, float] | None = None  # the gate, the near ones first, and how many returns it had

    def lost(self, ranges_m: Ranges, stride: int, *, least_m: float, moved_m: float) -> str:
        """Return which ranges have no returns any more, in words, or nothing; what is nearer than ``least_m`` is not missed.

        The ranges (N,) stand for ``stride`` returns each; since the sweep before the vehicle has moved by ``moved_m`` at most.
        What is lost is remembered until returns come from there again.
        """
        ranges = np.sort(ranges_m)
        factor, step_m = 1.0 + moved_m / LEAST_HEIGHT_M, STEP_M + moved_m
        moved = _counts(ranges, GATES_M * factor + step_m, GATES_M / factor - step_m, least_m) * stride
        if self._lost is None and len(self._recent) == RECENT:
            self._lost = self._missed(moved)
        if self._lost is not None and moved[self._lost[0]] >= LOST * self._lost[1]:
            self._lost = None
        if self._lost is None:
            self._recent.append(_counts(ranges, GATES_M, GATES_M, least_m) * stride)
            return ""
        begin_m, end_m = (float(ranges[min(len(ranges) - 1, int(share * len(ranges)))]) for share in (0.01, 0.99))
        return f"nearer than {begin_m:.1f} m" if self._lost[0] < len(GATES_M) else f"beyond {end_m:.1f} m"

    def _missed(self, moved: Floats) -> tuple[int, float] | None:
        """Return the gate of which most returns went at once, and how many it should have; None where there is none."""
        recent = np.array(self._recent)
        gradually = np.maximum(np.max(-np.diff(recent, axis=0), axis=0), 0.0)
        expected = recent.min(axis=0) - gradually
        total = recent[:, -1].min()
        least = np.repeat([LEAST_NEAR, LEAST_FAR], len(GATES_M)) * total
        gone = np.flatnonzero((expected[:-1] >= least) & (moved[:-1] < LOST * expected[:-1]))
        return (int(gone[0]), float(expected[gone[0]])) if len(gone) else None

    def forget(self) -> None:
        """Forget what was far: the vehicle is elsewhere. What is near belongs to a vehicle everywhere, and is missed until it is back."""
        self._recent.clear()
        if self._lost is not None and self._lost[0] >= len(GATES_M):
            self._lost = None


def _counts(ranges: Ranges, near_m: Edges, far_m: Edges, least_m: float) -> Floats:
    """Return how many of sorted ranges (N,) are nearer than each gate, how many beyond each, and how many there are, (2 * gates + 1,)."""
    begin = np.searchsorted(ranges, least_m)
    nearer = np.maximum(np.searchsorted(ranges, near_m) - begin, 0)
    beyond = len(ranges) - np.searchsorted(ranges, far_m)
    counts: Floats = np.concatenate([nearer, beyond, [len(ranges) - begin]]).astype(np.float64)
    return counts
