"""Is one camera turned inwards or outwards against the other? Then all disparities are wrong by about the same number of pixels.

No single pair shows it, unless what is far away seems to be beyond infinity (`view_health`). It shows in two ways:

- A knock changes the disparities of all features at once: by the same, where the sensor has moved behind its lens, or by more towards the
  edges, as a turn does. How features moved in the left image since the view before tells how the vehicle did, so what each disparity should
  be now: what the right camera sees of it instead is the knock, also while the vehicle stands.
- In flight, what is at a depth moves as that depth says. Disparities that are too large by a constant make what is far move as if it were
  near: the motion of the features tells the constant beside the scale of the depths, however long it has been there.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from perception_core import FINE, NS, FaultKind, Finding, broken
from zed_depth.feature_motion import LONGEST_NS, followed, motion_of, predicted, tracked, turned_far

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zed_depth.calibration import StereoGeometry
    from zed_depth.feature_motion import CameraPose, Compared, Landmarks

    Floats = NDArray[np.float64]
    Gray = NDArray[np.uint8]

LEVELS = 3  # of the pyramid in which features are followed where the motion is not known
FIRST_PX = (0.0, -6.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 6.0)  # constants that are tried first
FIRST_SCALES = (1.0, 0.8, 1.25)
LEAST_AGREEING, AGREE_PX = 0.6, 0.5  # of the features that are followed: the share that changes by the same, and by how many pixels
LEAST_FOLLOWED = 20
ROW_PX = 1.0  # by which the rows of a feature that is found may differ
SCALES = (0.85, 1.15)  # of the depths beside the constant: others are those of features that were mistaken
SURE = 0.2  # of a great offset, its standard deviation may be
NOT_TURNED = np.eye(4)


@dataclass(frozen=True)
class VergenceLimits:
    """Pixels of the image that is matched; measured on real and rendered flights, docs/experiments/perception.md.

    ``max_px`` is how much the disparities may be wrong by the motion: the middle one of the last ``estimates``, each surer than
    ``max_sigma_px`` or a fifth of it, within ``window_s``; where it is less than ``mended_px``, all is right again. ``max_knock_px`` is
    how much the disparities may have changed at once.
    """

    max_px: float = 1.0
    mended_px: float = 0.6
    max_knock_px: float = 0.7
    max_sigma_px: float = 0.2
    estimates: int = 5
    window_s: float = 10.0


class VergenceJudge:
    """Judge by views in their order; not thread-safe."""

    def __init__(self, limits: VergenceLimits) -> None:
        self._limits = limits
        self._before: tuple[int, Landmarks] | None = None
        self._knocked_px = 0.0  # since the motion last showed that the cameras are right
        self._estimates: deque[tuple[int, float]] = deque()
        self.finding: Finding = FINE
        """What was found last: what is turned stays so until a knock, or motion, shows otherwise."""

    @property
    def judged(self) -> bool:
        """Whether the motion has given enough estimates."""
        return len(self._estimates) >= self._limits.estimates

    def look(self, stamp_ns: int, landmarks: Landmarks, right: Gray, geometry: StereoGeometry, camera_pose: CameraPose) -> bool | None:
        """Take a view's features, and its right image by the light of the left one; return whether there was a knock since the last judged.

        None where that can't be said yet: the next view is then held against the same one, for a view after the knock shows none any more.
        A view is given up when it is too old, or when the left camera sees too little of it.
        """
        before = self._before
        if before is None or not 0 < stamp_ns - before[0] <= LONGEST_NS:
            self._before = (stamp_ns, landmarks)
            return False
        seen = SeenAgain.of(before[1], landmarks.image, _told(before[0], stamp_ns, camera_pose), geometry)
        if seen is None:
            self._before = (stamp_ns, landmarks)
            return None
        knock_px = seen.change_px(landmarks.image, right, geometry)
        if knock_px is None:
            return None
        self._before = (stamp_ns, landmarks)
        if abs(knock_px) <= self._limits.max_knock_px:
            return False
        self._knocked_px += knock_px
        self._estimates.clear()
        self._judged(self._knocked_px, self._limits.max_knock_px, "all disparities changed by {:.1f} px at once")
        return True

    def compare(self, views: Compared, geometry: StereoGeometry) -> None:
        """Take two views of a vehicle that moved in between."""
        offset = offset_of(views.seen, views.places, views.T_later_earlier, geometry)
        if offset is not None and offset[1] <= max(self._limits.max_sigma_px, SURE * abs(offset[0])):
            self.judge(views.stamp_ns, offset[0])

    def judge(self, stamp_ns: int, offset_px: float) -> None:
        """Take an estimate of how much the disparities are too large."""
        limits, known = self._limits, self._estimates
        known.append((stamp_ns, offset_px))
        while len(known) > limits.estimates or not 0 <= stamp_ns - known[0][0] <= limits.window_s * NS:
            known.popleft()
        if not self.judged:
            return
        middle = float(np.median([each for _, each in known]))
        if abs(middle) > limits.max_px:
            self._judged(middle, limits.max_px, "by the vehicle's own motion disparities are {:.1f} px off")
        elif abs(middle) < limits.mended_px:
            self._knocked_px, self.finding = 0.0, FINE

    def _judged(self, offset_px: float, most_px: float, told: str) -> None:
        way = "inwards" if offset_px > 0.0 else "outwards"
        told = f"the cameras are turned {way} against each other, {told.format(abs(offset_px))}"
        found = broken(FaultKind.CALIBRATION, told, "a camera has moved (calibrate the pair)", "one image is older than the other")
        self.finding = found if abs(offset_px) > most_px else FINE


def _told(earlier_ns: int, later_ns: int, camera_pose: CameraPose) -> Floats | None:
    """Return T_later_earlier by the poses, or None where they are not known."""
    earlier, later = camera_pose(earlier_ns), camera_pose(later_ns)
    return None if earlier is None or later is None else np.asarray(np.linalg.inv(later) @ earlier, dtype=np.float64)


@dataclass(frozen=True)
class SeenAgain:
    """Landmarks that the left camera sees again: their places (N, 2) in its image, and the disparities (N,) that they should have now."""

    places: Floats
    expected_px: Floats

    @classmethod
    def of(
        cls,
        earlier: Landmarks,
        left: Gray,
        T_later_earlier: Floats | None,  # noqa: N803 -- T_target_source
        geometry: StereoGeometry,
    ) -> SeenAgain | None:
        """Follow the landmarks to a later left image; None where too few are seen again, or the camera has turned far."""
        if T_later_earlier is None:
            seen, places = earlier, followed(earlier.image, left, earlier.places, earlier.places, levels=LEVELS)
            seen, places = seen.only(np.isfinite(places[:, 0])), places[np.isfinite(places[:, 0])]
            T_later_earlier = NOT_TURNED  # noqa: N806
        else:
            seen, places = tracked(earlier, left, T_later_earlier, geometry)
        if turned_far(T_later_earlier) or len(places) < LEAST_FOLLOWED:
            return None
        inverse_m = (seen.disparity_px - geometry.offset_px) / (geometry.fx * geometry.baseline_m)
        rays = predicted(seen, T_later_earlier, geometry)[0]
        motion = motion_of(rays, inverse_m[:, None] * np.eye(3)[:, None], places, geometry, np.array([T_later_earlier[:3, 3]]))
        if motion is None:
            return None
        sure = motion.weights > 0.5
        expected_px = (seen.disparity_px - geometry.offset_px) / motion.rays[:, 2] + geometry.offset_px
        return cls(places[sure], expected_px[sure])

    def change_px(self, left: Gray, right: Gray, geometry: StereoGeometry) -> float | None:
        """Return by how many pixels, in the middle of the image, all disparities are greater than expected; None where few agree.

        Of a sensor that moved behind its lens all change alike. Of a camera that turned about its vertical axis they change by 1 + u^2 of
        that, and the rows by u v, at (u, v) focal lengths from the right image's centre.
        """
        expected = np.stack([self.expected_px, np.zeros_like(self.expected_px)], axis=1)
        found = followed(left, right, self.places, self.places - expected, levels=LEVELS)
        known = np.isfinite(found[:, 0])
        change = (self.places - found - expected)[known]
        u, v = ((found[known] - [geometry.cx - geometry.offset_px, geometry.cy]) / [geometry.fx, geometry.fy]).T
        moved, turned = np.stack([np.ones_like(u), np.zeros_like(u)], axis=1), np.stack([1.0 + u * u, u * v], axis=1)
        share, change_px = max(_agreeing(change, way) for way in (moved, turned))
        return change_px if share >= LEAST_AGREEING else None


def _agreeing(change: Floats, way: Floats) -> tuple[float, float]:
    """Return the share of changes (N, 2) that are the same multiple of their ways (N, 2), and that multiple; of few the share is 0."""
    if len(change) < LEAST_FOLLOWED:
        return 0.0, 0.0
    rough = float(np.median(change[:, 0] / way[:, 0]))
    usable = np.abs(change[:, 1] - rough * way[:, 1]) < ROW_PX
    if np.count_nonzero(usable) < LEAST_FOLLOWED:
        return 0.0, 0.0
    multiple = change[usable, 0] / way[usable, 0]
    middle = float(np.median(multiple))
    return float(np.mean(np.abs(multiple - middle) * way[usable, 0] < AGREE_PX)), middle


def offset_of(
    earlier: Landmarks,
    places: Floats,
    T_later_earlier: Floats,  # noqa: N803 -- T_target_source
    geometry: StereoGeometry,
) -> tuple[float, float] | None:
    """Return by how many pixels the disparities of landmarks are too large, and its standard deviation, or None.

    ``places`` (N, 2) are the landmarks' in a later image, ``T_later_earlier`` is the camera's motion (4, 4).
    """
    if turned_far(T_later_earlier) or len(places) < LEAST_FOLLOWED:
        return None
    per_m = geometry.fx * geometry.baseline_m
    turned, moved = predicted(earlier, T_later_earlier, geometry)
    moves = np.stack([moved, np.broadcast_to(T_later_earlier[:3, 3], moved.shape)])
    first = np.array([(scale, -scale * offset_px / per_m) for scale in FIRST_SCALES for offset_px in FIRST_PX])
    motion = motion_of(turned, moves, places, geometry, first)
    if motion is None or not SCALES[0] <= motion.factors[0] <= SCALES[1]:
        return None
    scale, constant = motion.factors
    return float(-constant * per_m / scale), float(motion.sigmas[1] * per_m / scale)
