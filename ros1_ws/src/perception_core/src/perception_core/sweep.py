"""Straighten a LiDAR sweep: bring points that were measured one after the other from a moving vehicle into the map."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from perception_core.poses import NS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from perception_core.poses import PoseBuffer, Poses

    Floats = NDArray[np.float64]
    Floats32 = NDArray[np.float32]

KNOT_S = 0.01


@dataclass(frozen=True)
class Sweep:
    """One cloud: ``points`` (N, 3) float32 in the sensor's frame, metres; ``times_s`` (N,) seconds since ``stamp_ns``."""

    stamp_ns: int
    points: NDArray[np.float32]
    times_s: NDArray[np.float32]

    @property
    def end_ns(self) -> int:
        """The moment of the last measurement."""
        known = self.times_s[np.isfinite(self.times_s)]
        return self.stamp_ns + (int(float(known.max()) * NS) if len(known) else 0)

    def select(self, mask: NDArray[np.bool_] | NDArray[np.intp]) -> Sweep:
        """Return the sweep with only these points."""
        if mask.dtype == np.bool_ and mask.all():
            return self
        # Taken by numbers: numpy is three times as slow with a mask on rows of three.
        kept = np.flatnonzero(mask) if mask.dtype == np.bool_ else mask
        return Sweep(stamp_ns=self.stamp_ns, points=self.points.take(kept, axis=0), times_s=self.times_s.take(kept))

    def within(self, min_range_m: float, max_range_m: float) -> Sweep:
        """Return the sweep without points nearer, farther, or not finite; their times go with them, and points without a time go, too."""
        squared = np.einsum("ij,ij->i", self.points, self.points)
        return self.select((squared >= min_range_m**2) & (squared <= max_range_m**2) & np.isfinite(self.times_s))


def deskew(sweep: Sweep, poses: PoseBuffer, T_base_sensor: Floats) -> Floats:  # noqa: N803 -- T_target_source
    """Return the points in the map, (N, 3), each moved by the pose of its own moment; raise PoseUnavailableError."""
    if not len(sweep.points):
        return np.empty((0, 3))
    begin, end = float(sweep.times_s.min()), float(sweep.times_s.max())
    knots_s = np.linspace(begin, end, max(2, int(np.ceil((end - begin) / KNOT_S)) + 1), dtype=np.float64)
    at_knots = poses.at([sweep.stamp_ns + int(knot * NS) for knot in knots_s])
    return straighten(sweep.points @ T_base_sensor[:3, :3].T + T_base_sensor[:3, 3], sweep.times_s, knots_s, at_knots)


def straighten(points: Floats, times_s: Floats | Floats32, knots_s: Floats, at_knots: Poses) -> Floats:
    """Move each point (N, 3) from the vehicle's frame at its own time (N,) into the map; the poses are those of the knots (K,), in order.

    A point between two knots is moved by both and blended: at knots of 10 ms that differs from the exact motion by less than a millimetre
    at 20 m and 60 degrees/s. By one interval at most the motion is continued beyond the last knot.
    """
    if len(knots_s) == 1:
        only: Floats = points @ at_knots.rotation[0].T + at_knots.position[0]
        return only
    order = None if np.all(times_s[1:] >= times_s[:-1]) else np.argsort(times_s, kind="stable")
    points, times_s = (points, times_s) if order is None else (points.take(order, axis=0), times_s.take(order))
    # In the order of time, what lies between two knots is one slice.
    ends = [0, *np.searchsorted(times_s, knots_s[1:-1]), len(points)]
    moved = np.empty((len(points), 3))
    for k, (begin, end) in enumerate(pairwise(ends)):
        interval_s = max(knots_s[k + 1] - knots_s[k], 1e-9)
        share = np.clip((times_s[begin:end] - knots_s[k]) / interval_s, 0.0, 2.0)[:, None]
        before = points[begin:end] @ at_knots.rotation[k].T + at_knots.position[k]
        after = points[begin:end] @ at_knots.rotation[k + 1].T + at_knots.position[k + 1]
        moved[begin:end] = before + share * (after - before)
    if order is None:
        return moved
    result = np.empty_like(moved)
    result[order] = moved
    return result
