"""Straighten a LiDAR sweep: bring points that were measured one after the other from a moving vehicle into the map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from perception_core.poses import NS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from perception_core.poses import PoseBuffer

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
        return Sweep(stamp_ns=self.stamp_ns, points=self.points[mask], times_s=self.times_s[mask])

    def within(self, min_range_m: float, max_range_m: float) -> Sweep:
        """Return the sweep without points nearer, farther, or not finite; their times go with them, and points without a time go, too."""
        squared = np.einsum("ij,ij->i", self.points, self.points)
        return self.select((squared >= min_range_m**2) & (squared <= max_range_m**2) & np.isfinite(self.times_s))


def deskew(sweep: Sweep, poses: PoseBuffer, T_base_sensor: NDArray[np.float64]) -> NDArray[np.float64]:  # noqa: N803 -- T_target_source
    """Return the points in the map, (N, 3), each moved by the pose of its own moment.

    Poses are taken every 10 ms; a point between two of them is moved by both and blended, which differs from the exact motion by less
    than a millimetre at 20 m and 60 degrees/s. Raises PoseUnavailableError.
    """
    if not len(sweep.points):
        return np.empty((0, 3))
    body = sweep.points @ T_base_sensor[:3, :3].T + T_base_sensor[:3, 3]
    begin, end = float(sweep.times_s.min()), float(sweep.times_s.max())
    knots_s = np.linspace(begin, end, max(2, int(np.ceil((end - begin) / KNOT_S)) + 1))
    at_knots = poses.at([sweep.stamp_ns + int(knot * NS) for knot in knots_s])
    spacing_s = max(knots_s[1] - knots_s[0], 1e-9)
    place = np.clip((sweep.times_s - begin) / spacing_s, 0.0, len(knots_s) - 1 - 1e-6)
    segment = place.astype(np.intp)
    share = (place - segment)[:, None]
    result = np.empty((len(body), 3))
    for k in range(len(knots_s) - 1):
        of_segment = np.flatnonzero(segment == k)
        points = body[of_segment]
        before = points @ at_knots.rotation[k].T + at_knots.position[k]
        after = points @ at_knots.rotation[k + 1].T + at_knots.position[k + 1]
        result[of_segment] = before + share[of_segment] * (after - before)
    return result
