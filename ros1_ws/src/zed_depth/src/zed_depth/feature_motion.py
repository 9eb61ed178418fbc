"""How features move in the left image while the vehicle does: the views that are compared, and the motion that explains what moved.

The depth of a feature and the way that the autopilot says the vehicle went tell where the feature must be in a later image. By what factors
the depths' parts of that motion must be multiplied until the features of both images meet shows what is wrong with the depths. A small
rotation is solved for with it: a degree of error of the attitude moves features as far as a tenth of a metre of motion does.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import NS

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
MOST_TURNED_RAD = 0.5
LEAST_FEATURES = 25
LEAST_DEPTH = 0.05  # in the later view, of what was at 1 in the earlier one; nearer is passed by
AGREE_PX = 4.0
OUTLIER_PX = (4.0, 4.0, 3.0, 2.0, 1.5, 1.0, 1.0, 1.0)  # at which the weight of a feature falls to a half, step by step
WINDOW_PX = 15  # around a feature that is followed
LEVELS = 2  # of the pyramid in which it is followed from view to view: some ten pixels from where it should be


@dataclass(frozen=True)
class Landmarks:
    """Features of one left image: places (N, 2) and disparities (N,) in pixels."""

    image: Gray
    places: Floats
    disparity_px: Floats

    def only(self, chosen: NDArray[np.bool_]) -> Landmarks:
        """Return the chosen ones (N,)."""
        return Landmarks(self.image, self.places[chosen], self.disparity_px[chosen])


@dataclass(frozen=True)
class KnownView:
    """Features of one left image, and where its camera was."""

    stamp_ns: int
    landmarks: Landmarks
    T_map_camera: Floats


class Views:
    """The last views of a vehicle, in their order; not thread-safe."""

    def __init__(self) -> None:
        self._waiting: tuple[int, Landmarks] | None = None
        self._views: deque[KnownView] = deque()

    def clear(self) -> None:
        """Forget all views: what is seen from now on can't be compared with them."""
        self._waiting = None
        self._views.clear()

    def take(self, stamp_ns: int, landmarks: Landmarks, camera_pose: CameraPose) -> tuple[KnownView, KnownView] | None:
        """Take a view; return an earlier and a later one that are to be compared, or None.

        A view is compared when the next one comes: then the pose of its moment has arrived.
        """
        waiting, self._waiting = self._waiting, (stamp_ns, landmarks)
        if waiting is None or not 0 < stamp_ns - waiting[0] <= LONGEST_NS:
            self._views.clear()
            return None
        pose = camera_pose(waiting[0])
        if pose is None:
            return None
        view = KnownView(*waiting, pose)
        while self._views and not 0 < view.stamp_ns - self._views[0].stamp_ns <= LONGEST_NS:
            self._views.popleft()
        earlier = next((other for other in reversed(self._views) if _way_m(other, view) >= WAY_M), None)
        self._views.append(view)
        return None if earlier is None else (earlier, view)


def turned_far(T_later_earlier: Floats) -> bool:  # noqa: N803 -- T_target_source
    """Return whether the camera turned too far between two views for them to be compared."""
    cosine = float(np.clip((np.trace(T_later_earlier[:3, :3]) - 1.0) / 2.0, -1.0, 1.0))
    return math.acos(cosine) > MOST_TURNED_RAD


def _way_m(one: KnownView, other: KnownView) -> float:
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
    turned, moved = predicted(earlier, T_later_earlier, geometry)
    guesses = projected(turned + moved, geometry)
    height, width = image.shape
    seen = (turned + moved)[:, 2] > LEAST_DEPTH
    seen &= np.all((guesses >= 0.0) & (guesses < [width, height]), axis=1)
    places = followed(earlier.image, image, earlier.places[seen], guesses[seen], levels=LEVELS)
    known = np.isfinite(places[:, 0])
    return earlier.only(seen).only(known), places[known]


@dataclass(frozen=True)
class Compared:
    """Two views of a vehicle that moved in between.

    ``seen`` are the earlier view's landmarks that the later one shows, too, ``places`` (N, 2) theirs in it. ``T_later_earlier`` (4, 4) is
    the camera's motion by the poses, ``stamp_ns`` the later view's.
    """

    stamp_ns: int
    T_later_earlier: Floats
    seen: Landmarks
    places: Floats

    @classmethod
    def of(cls, earlier: KnownView, later: KnownView, geometry: StereoGeometry) -> Compared:
        """Follow the earlier view's landmarks to the later one."""
        T_later_earlier: Floats = np.linalg.inv(later.T_map_camera) @ earlier.T_map_camera  # noqa: N806 -- T_target_source
        return cls(later.stamp_ns, T_later_earlier, *tracked(earlier.landmarks, later.landmarks.image, T_later_earlier, geometry))


def predicted(landmarks: Landmarks, T_later_earlier: Floats, geometry: StereoGeometry) -> tuple[Floats, Floats]:  # noqa: N803
    """Return the rays to the landmarks, turned into the later view, and how they move to it, (N, 3) each, for a depth of 1 before it."""
    x, y = landmarks.places.T
    rays = np.column_stack([(x - geometry.cx) / geometry.fx, (y - geometry.cy) / geometry.fy, np.ones(len(x))])
    inverse_m = (landmarks.disparity_px - geometry.offset_px) / (geometry.fx * geometry.baseline_m)
    return rays @ T_later_earlier[:3, :3].T, inverse_m[:, None] * T_later_earlier[:3, 3]


@dataclass(frozen=True)
class Motion:
    """What `motion_of` found: ``factors`` (K,), their standard deviations, the rays (N, 3) in the later view, and their weights (N,)."""

    factors: Floats
    sigmas: Floats
    rays: Floats
    weights: Floats


def motion_of(turned: Floats, moves: Floats, places: Floats, geometry: StereoGeometry, first: Floats) -> Motion | None:
    """Find the factors (K,), and a small rotation, by which rays (N, 3), ``turned`` and moved by ``moves`` (K, N, 3), meet places (N, 2).

    Gauss-Newton with weights of Cauchy from the best of some ``first`` factors (M, K) on; the rays are scaled to a depth of 1 at the
    earlier view. None where fewer than `LEAST_FEATURES` agree.
    """
    factors = first[np.argmax(_agreeing(places - projected(turned + np.tensordot(first, moves, 1), geometry)))].copy()
    normal, variance = np.eye(len(factors) + 3), 0.0
    weights = np.zeros(len(places))
    for outlier_px in OUTLIER_PX:
        points = turned + np.tensordot(factors, moves, 1)
        errors = places - projected(points, geometry)
        weights = (points[:, 2] > LEAST_DEPTH) / (1.0 + np.sum(errors**2, axis=1) / outlier_px**2)
        variance = float(np.sum(weights[:, None] * errors**2)) / max(1.0, 2.0 * float(weights.sum()) - len(normal))
        jacobian = _jacobian(points, moves, geometry)
        normal = np.einsum("n,nki,nkj->ij", weights, jacobian, jacobian)
        change = np.linalg.lstsq(normal, np.einsum("n,nki,nk->i", weights, jacobian, errors), rcond=None)[0]
        factors += change[:-3]
        small = cv2.Rodrigues(change[-3:])[0]
        turned, moves = turned @ small.T, moves @ small.T
    if np.count_nonzero(weights > 0.5) < LEAST_FEATURES:
        return None
    sigmas = np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(normal)), 0.0))[:-3]
    return Motion(factors, sigmas, turned + np.tensordot(factors, moves, 1), weights)


def _agreeing(errors: Floats) -> NDArray[np.intp]:
    """Return how many errors (M, N, 2) in pixels are near the middle one, (M,): a wrong attitude moves all features alike."""
    off = errors - np.median(errors, axis=1, keepdims=True)
    agreeing: NDArray[np.intp] = np.sum(np.sum(off**2, axis=2) < AGREE_PX**2, axis=1)
    return agreeing


def projected(points: Floats, geometry: StereoGeometry) -> Floats:
    """Return the places (..., 2) in pixels of points (..., 3)."""
    x, y, z = np.moveaxis(points, -1, 0)
    ahead = np.maximum(z, LEAST_DEPTH)
    return np.stack([geometry.fx * x / ahead + geometry.cx, geometry.fy * y / ahead + geometry.cy], axis=-1)


def _jacobian(points: Floats, moves: Floats, geometry: StereoGeometry) -> Floats:
    """Return how the places (N, 2) of points (N, 3) change with factors of moves (K, N, 3) and with a small rotation, (N, 2, K + 3)."""
    x, y, z = points.T
    ahead = np.maximum(z, LEAST_DEPTH)
    none = np.zeros_like(x)
    directions = np.stack([*moves, np.stack([none, -z, y], 1), np.stack([z, none, -x], 1), np.stack([-y, x, none], 1)], axis=2)
    to_pixels = np.stack(
        [
            np.stack([geometry.fx / ahead, none, -geometry.fx * x / ahead**2], 1),
            np.stack([none, geometry.fy / ahead, -geometry.fy * y / ahead**2], 1),
        ],
        axis=1,
    )
    jacobian: Floats = to_pixels @ directions
    return jacobian
