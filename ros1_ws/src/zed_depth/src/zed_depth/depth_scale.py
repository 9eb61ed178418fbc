"""Is the scale of the depths right? Judged in flight, by how features move in the image while the vehicle moves.

A wrong baseline or focal length makes all depths too long or too short by one factor, which no single pair shows. The depth of a feature
and the way that the autopilot says the vehicle went tell where the feature must be in a later image. The factor by which that way must be
multiplied until the features of both images meet is the scale of the depths. A small rotation is solved for with it: a degree of error of
the attitude moves features as far as a tenth of a metre of motion does.

Nothing is said of a vehicle that stands, and where too few features are seen twice. A wrong focal length scales the depths along the view
only, so it shows while the vehicle flies along the camera's view, a wrong baseline in every motion.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import FINE, NS, FaultKind, Finding, broken

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from zed_depth.calibration import StereoGeometry

    Floats = NDArray[np.float64]
    Gray = NDArray[np.uint8]

    CameraPose = Callable[[int], Floats | None]
    """Returns T_map_camera, (4, 4), of a moment in nanoseconds; None where it is not known."""

WAY_M = 0.8  # between two views that are compared: features move by many pixels, and most of them are still seen
LONGEST_NS = 3 * NS  # between two views: the autopilot's position drifts
LEAST_DISPARITY_PX = 4.0  # of what is farther, the disparity is not known to a tenth, and noise makes more of it seem nearer than farther
MOST_TURNED_RAD = 0.5
LEAST_FEATURES = 25
LEAST_DEPTH = 0.05  # in the later view, of what was at 1 in the earlier one; nearer is passed by
FIRST_SCALES = (1.0, 0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.25, 1.4, 1.6, 1.8, 2.0)
AGREE_PX = 4.0
OUTLIER_PX = (4.0, 4.0, 3.0, 2.0, 1.5, 1.0, 1.0, 1.0)  # at which the weight of a feature falls to a half, step by step
WINDOW_PX = 15  # around a feature that is followed
LEVELS = 2  # of the pyramid in which it is followed from view to view: some ten pixels from where it should be


@dataclass(frozen=True)
class ScaleLimits:
    """When the scale of the depths is not believed; measured in rendered flights, docs/experiments/perception.md.

    ``max_error`` is of the depth. The last ``estimates`` within ``window_s`` must be there, each surer than ``max_sigma``.
    """

    max_error: float = 0.1
    estimates: int = 6
    window_s: float = 10.0
    max_sigma: float = 0.015


@dataclass(frozen=True)
class Landmarks:
    """Features of one left image: places (N, 2) and disparities (N,) in pixels."""

    image: Gray
    places: Floats
    disparity_px: Floats


@dataclass(frozen=True)
class Estimate:
    """The scale of the depths by two views: 1.1 where they are a tenth too long, and its standard deviation."""

    scale: float
    sigma: float


@dataclass(frozen=True)
class _View:
    stamp_ns: int
    landmarks: Landmarks
    T_map_camera: Floats


class ScaleJudge:
    """Judge the depths' scale by views in their order; not thread-safe."""

    def __init__(self, limits: ScaleLimits) -> None:
        self._limits = limits
        self._waiting: tuple[int, Landmarks] | None = None
        self._views: deque[_View] = deque()
        self._estimates: deque[tuple[int, float]] = deque()
        self.finding: Finding = FINE
        """What was found last: a wrong scale stays wrong while the vehicle stands, until motion shows otherwise."""

    def take(self, stamp_ns: int, landmarks: Landmarks, geometry: StereoGeometry, camera_pose: CameraPose) -> None:
        """Take a view. It is compared when the next one comes: then the pose of its moment has arrived."""
        waiting, self._waiting = self._waiting, (stamp_ns, landmarks)
        if waiting is None or not 0 < stamp_ns - waiting[0] <= LONGEST_NS:
            self._views.clear()
            return
        pose = camera_pose(waiting[0])
        if pose is not None:
            self._compare(_View(*waiting, pose), geometry)

    def _compare(self, view: _View, geometry: StereoGeometry) -> None:
        while self._views and not 0 < view.stamp_ns - self._views[0].stamp_ns <= LONGEST_NS:
            self._views.popleft()
        earlier = next((other for other in reversed(self._views) if _way_m(other, view) >= WAY_M), None)
        self._views.append(view)
        if earlier is None:
            return
        T_view_earlier = np.linalg.inv(view.T_map_camera) @ earlier.T_map_camera  # noqa: N806 -- T_target_source
        seen, places = tracked(earlier.landmarks, view.landmarks.image, T_view_earlier, geometry)
        estimate = scale_of(seen, places, T_view_earlier, geometry)
        if estimate is not None and estimate.sigma <= self._limits.max_sigma:
            self.judge(view.stamp_ns, estimate.scale)

    def judge(self, stamp_ns: int, scale: float) -> None:
        """Take an estimate of the scale."""
        limits, known = self._limits, self._estimates
        known.append((stamp_ns, scale))
        while len(known) > limits.estimates or not 0 <= stamp_ns - known[0][0] <= limits.window_s * NS:
            known.popleft()
        if len(known) < limits.estimates:
            return
        error = float(np.median([each for _, each in known])) - 1.0
        if abs(error) <= limits.max_error:
            self.finding = FINE
            return
        told = f"the depths are about {abs(error):.0%} too {'long' if error > 0 else 'short'} by the vehicle's own motion"
        self.finding = broken(FaultKind.CALIBRATION, f"{told}: check the focal length and the baseline")


def _way_m(one: _View, other: _View) -> float:
    return float(np.linalg.norm(one.T_map_camera[:3, 3] - other.T_map_camera[:3, 3]))


def followed(image: Gray, other: Gray, places: Floats, guesses: Floats, *, levels: int) -> Floats:
    """Return where the features at places (N, 2) are in another image, by Lucas and Kanade from the guesses (N, 2) on; NaN where lost."""
    if not len(places):
        return np.empty((0, 2))
    start, guess = (np.ascontiguousarray(where, dtype=np.float32).reshape(-1, 1, 2) for where in (places, guesses))
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        image, other, start, guess, winSize=(WINDOW_PX, WINDOW_PX), maxLevel=levels, flags=cv2.OPTFLOW_USE_INITIAL_FLOW
    )
    return np.where(np.asarray(status).reshape(-1, 1) == 1, np.asarray(found).reshape(-1, 2), np.nan).astype(np.float64)


def tracked(
    earlier: Landmarks,
    image: Gray,
    T_later_earlier: Floats,  # noqa: N803 -- T_target_source
    geometry: StereoGeometry,
) -> tuple[Landmarks, Floats]:
    """Return those landmarks that are found again in a later image, and their places (N, 2) there."""
    turned, moved = _predicted(earlier, T_later_earlier, geometry)
    guesses = _projected(turned + moved, geometry)
    height, width = image.shape
    near = (earlier.disparity_px - geometry.offset_px >= LEAST_DISPARITY_PX) & ((turned + moved)[:, 2] > LEAST_DEPTH)
    near &= np.all((guesses >= 0.0) & (guesses < [width, height]), axis=1)
    places = followed(earlier.image, image, earlier.places[near], guesses[near], levels=LEVELS)
    known = np.isfinite(places[:, 0])
    return Landmarks(earlier.image, earlier.places[near][known], earlier.disparity_px[near][known]), places[known]


def scale_of(
    earlier: Landmarks,
    places: Floats,
    T_later_earlier: Floats,  # noqa: N803 -- T_target_source
    geometry: StereoGeometry,
) -> Estimate | None:
    """Return the scale of the depths by landmarks, their places (N, 2) in a later image and the camera's motion (4, 4), or None."""
    turned = float(np.clip((np.trace(T_later_earlier[:3, :3]) - 1.0) / 2.0, -1.0, 1.0))
    if math.acos(turned) > MOST_TURNED_RAD or len(places) < LEAST_FEATURES:
        return None
    return _solved(*_predicted(earlier, T_later_earlier, geometry), places, geometry)


def _predicted(landmarks: Landmarks, T_later_earlier: Floats, geometry: StereoGeometry) -> tuple[Floats, Floats]:  # noqa: N803
    """Return the rays to the landmarks, turned into the later view, and how they move to it, (N, 3) each, for a depth of 1 before it."""
    x, y = landmarks.places.T
    rays = np.column_stack([(x - geometry.cx) / geometry.fx, (y - geometry.cy) / geometry.fy, np.ones(len(x))])
    inverse_m = (landmarks.disparity_px - geometry.offset_px) / (geometry.fx * geometry.baseline_m)
    return rays @ T_later_earlier[:3, :3].T, inverse_m[:, None] * T_later_earlier[:3, 3]


def _solved(turned: Floats, moved: Floats, places: Floats, geometry: StereoGeometry) -> Estimate | None:
    """Find the scale, and a small rotation, by which rays (N, 3) that are ``turned`` and ``moved`` by the motion meet places (N, 2).

    Gauss-Newton with weights of Cauchy from the best of some scales on; the rays are scaled to a depth of 1 at the earlier view.
    """
    scale = max(FIRST_SCALES, key=lambda tried: _agreeing(places - _projected(turned + tried * moved, geometry)))
    normal, variance = np.eye(4), 0.0
    weights = np.zeros(len(places))
    for outlier_px in OUTLIER_PX:
        points = turned + scale * moved
        errors = places - _projected(points, geometry)
        weights = (points[:, 2] > LEAST_DEPTH) / (1.0 + np.sum(errors**2, axis=1) / outlier_px**2)
        variance = float(np.sum(weights[:, None] * errors**2)) / max(1.0, 2.0 * float(weights.sum()) - 4.0)
        jacobian = _jacobian(points, moved, geometry)
        normal = np.einsum("n,nki,nkj->ij", weights, jacobian, jacobian)
        change = np.linalg.lstsq(normal, np.einsum("n,nki,nk->i", weights, jacobian, errors), rcond=None)[0]
        scale += float(change[0])
        small = cv2.Rodrigues(change[1:])[0]
        turned, moved = turned @ small.T, moved @ small.T
    if np.count_nonzero(weights > 0.5) < LEAST_FEATURES or scale <= 0.0:
        return None
    return Estimate(scale, math.sqrt(variance * float(np.linalg.pinv(normal)[0, 0])))


def _agreeing(errors: Floats) -> int:
    """Return how many errors (N, 2) in pixels are near the middle one: a wrong attitude moves all features alike."""
    off = errors - np.median(errors, axis=0)
    return int(np.count_nonzero(np.sum(off**2, axis=1) < AGREE_PX**2))


def _projected(points: Floats, geometry: StereoGeometry) -> Floats:
    """Return the places (N, 2) in pixels of points (N, 3)."""
    ahead = np.maximum(points[:, 2], LEAST_DEPTH)
    return np.column_stack([geometry.fx * points[:, 0] / ahead + geometry.cx, geometry.fy * points[:, 1] / ahead + geometry.cy])


def _jacobian(points: Floats, moved: Floats, geometry: StereoGeometry) -> Floats:
    """Return how the places (N, 2) of points (N, 3) change with the scale and with a small rotation, (N, 2, 4)."""
    x, y, z = points.T
    ahead = np.maximum(z, LEAST_DEPTH)
    none = np.zeros_like(x)
    directions = np.stack([moved, np.stack([none, -z, y], 1), np.stack([z, none, -x], 1), np.stack([-y, x, none], 1)], axis=2)
    to_pixels = np.stack(
        [
            np.stack([geometry.fx / ahead, none, -geometry.fx * x / ahead**2], 1),
            np.stack([none, geometry.fy / ahead, -geometry.fy * y / ahead**2], 1),
        ],
        axis=1,
    )
    jacobian: Floats = to_pixels @ directions
    return jacobian
