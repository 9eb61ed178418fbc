"""Is the scale of the depths right? Judged in flight, by how features move in the image while the vehicle moves (`feature_motion`).

A wrong baseline or focal length makes all depths too long or too short by one factor, which no single pair shows: the factor by which the
vehicle's way must be multiplied until the features of both images meet is the scale of the depths.

Nothing is said of a vehicle that stands, and where too few features are seen twice. A wrong focal length scales the depths along the view
only, so it shows while the vehicle flies along the camera's view, a wrong baseline in every motion.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from perception_core import FINE, NS, FaultKind, Finding, broken
from zed_depth.feature_motion import LEAST_FEATURES, motion_of, predicted, turned_far

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zed_depth.calibration import StereoGeometry
    from zed_depth.feature_motion import Compared, Landmarks

    Floats = NDArray[np.float64]

LEAST_DISPARITY_PX = 4.0  # of what is farther, the disparity is not known to a tenth, and noise makes more of it seem nearer than farther
FIRST_SCALES = np.array([[1.0], [0.5], [0.6], [0.7], [0.8], [0.9], [1.1], [1.25], [1.4], [1.6], [1.8], [2.0]])


@dataclass(frozen=True)
class ScaleLimits:
    """When the scale of the depths counts as wrong; measured in rendered flights, docs/experiments/perception.md.

    ``max_error`` is of the depth. The last ``estimates`` within ``window_s`` must be there, each surer than ``max_sigma``.
    """

    max_error: float = 0.1
    estimates: int = 6
    window_s: float = 10.0
    max_sigma: float = 0.015


@dataclass(frozen=True)
class Estimate:
    """The scale of the depths by two views: 1.1 where they are a tenth too long, and its standard deviation."""

    scale: float
    sigma: float


class ScaleJudge:
    """Judge the depths' scale by views in their order; not thread-safe."""

    def __init__(self, limits: ScaleLimits) -> None:
        self._limits = limits
        self._estimates: deque[tuple[int, float]] = deque()
        self.finding: Finding = FINE
        """What was found last: a wrong scale stays wrong while the vehicle stands, until motion shows otherwise."""

    @property
    def judged(self) -> bool:
        """Whether there are enough estimates."""
        return len(self._estimates) >= self._limits.estimates

    def compare(self, views: Compared, geometry: StereoGeometry) -> None:
        """Compare two views of a vehicle that moved in between."""
        near = views.seen.disparity_px - geometry.offset_px >= LEAST_DISPARITY_PX
        estimate = scale_of(views.seen.only(near), views.places[near], views.T_later_earlier, geometry)
        if estimate is not None and estimate.sigma <= self._limits.max_sigma:
            self.judge(views.stamp_ns, estimate.scale)

    def judge(self, stamp_ns: int, scale: float) -> None:
        """Add an estimate of the scale."""
        limits, known = self._limits, self._estimates
        known.append((stamp_ns, scale))
        while len(known) > limits.estimates or not 0 <= stamp_ns - known[0][0] <= limits.window_s * NS:
            known.popleft()
        if not self.judged:
            return
        error = float(np.median([each for _, each in known])) - 1.0
        if abs(error) <= limits.max_error:
            self.finding = FINE
            return
        told = f"the depths are about {abs(error):.0%} too {'long' if error > 0 else 'short'} by the vehicle's own motion"
        self.finding = broken(
            FaultKind.CALIBRATION, told, "focal length or baseline of camera_info is wrong", "the autopilot's velocity is wrong"
        )


def scale_of(
    earlier: Landmarks,
    places: Floats,
    T_later_earlier: Floats,  # noqa: N803 -- T_target_source
    geometry: StereoGeometry,
) -> Estimate | None:
    """Return the scale of the depths by landmarks, their places (N, 2) in a later image and the camera's motion (4, 4), or None."""
    if turned_far(T_later_earlier) or len(places) < LEAST_FEATURES:
        return None
    turned, moved = predicted(earlier, T_later_earlier, geometry)
    motion = motion_of(turned, moved[None], places, geometry, FIRST_SCALES)
    return None if motion is None or motion.factors[0] <= 0.0 else Estimate(float(motion.factors[0]), float(motion.sigmas[0]))
