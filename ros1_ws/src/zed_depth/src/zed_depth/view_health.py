"""What both images together tell of the rig: do the cameras see the same scene, and as a rectified pair does?

Features of both images (ORB) are matched without any knowledge of the geometry. Of a rectified pair, matches lie in one row, and never more
to the right in the right image. A fit of the vertical offset over the image tells a shifted, a turned and a zoomed camera apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import FINE, FaultKind, Finding, broken, unsure
from zed_depth.depth_scale import Landmarks, landmarks_of
from zed_depth.stereo import noise_level

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]
    Floats = NDArray[np.float64]

FEATURES = 400
FAST_THRESHOLDS = ((60, 300), (25, 120), (7, 0))  # contrast of the corners, and how many are enough not to look for fainter ones
ABOVE_NOISE = 2.5  # deviations of the noise: fainter corners are made by it, and match by chance
FEW_FEATURES = 60
ENOUGH_FEATURES = 120
ENOUGH_MATCHES = 20
AGREE_PX = 2.0
FIRST_GUESS_SHARE = 0.03  # of the height: by as much the rows of a camera that is off may differ over the image
FITS = 4
EDGE_PX = 9
TILES = (8, 20)  # rows and columns in which both images are compared for a lens that is partly covered,
TILE_CELLS = 5  # each cut into 5 x 5 averages, which have a third of the pixels' noise or less
CONTENT, NO_CONTENT = 6.0, 2.0  # grey levels, deviation within a tile
REACH = 0.2  # of the width: the farthest that content is looked for
COVERED = 0.08  # of the tiles
STRONGEST = 99.5  # percentile of the gradient: the edges that are looked at


@dataclass(frozen=True)
class ViewLimits:
    """Pixels of the image that is matched, and shares (0..1); measured on real images, see docs/perception.md."""

    max_vertical_px: float = 1.0
    min_agreeing: float = 0.25
    max_negative: float = 0.5
    min_parallax_px: float = 0.5
    max_edge_px: float = 6.0


@dataclass(frozen=True)
class Matches:
    """Matched features: places in the left image (N, 2), and how much lower (N,) and more to the left (N,) they are in the right one."""

    count_left: int
    count_right: int
    places: Floats
    vertical_px: Floats
    disparity_px: Floats


@dataclass(frozen=True)
class View:
    """What both images together tell: the finding, and the features in which they agree, where it is OK."""

    finding: Finding
    landmarks: Landmarks | None = None


def view_of(left: Gray, right: Gray, *, offset_px: float, limits: ViewLimits) -> View:
    """Hold both images of a rectified pair against each other; ``offset_px`` is the disparity of infinity."""
    for side, image in (("left", left), ("right", right)):
        width_px = edge_width_px(image)
        if width_px > limits.max_edge_px:
            return View(broken(FaultKind.BLUR, f"{side} image is blurred: its sharpest edges are {width_px:.1f} px wide"))
    if np.array_equal(left, right):
        return View(broken(FaultKind.VIEW, "both cameras deliver the same image"))
    matches = match(left, right)
    fit = fit_rows(matches, FIRST_GUESS_SHARE * left.shape[0])
    disparity_px = matches.disparity_px[fit.agree]
    # A lens that is partly covered leaves few features, which may seem to be turned: it is looked for first.
    trouble = (
        _scene_finding(matches, fit, limits)
        or _covered_finding(left, right, offset_px)
        or _rows_finding(fit, left.shape, limits)
        or _disparity_finding(disparity_px - offset_px, limits)
    )
    if trouble is not None:
        return View(trouble)
    return View(FINE, landmarks_of(left, right, matches.places[fit.agree], disparity_px))


def _scene_finding(matches: Matches, fit: RowFit, limits: ViewLimits) -> Finding | None:
    fewest = min(matches.count_left, matches.count_right)
    if fewest < FEW_FEATURES:
        return unsure(FaultKind.VIEW, f"too little texture to judge the cameras: {fewest} features")
    agreeing = int(np.count_nonzero(fit.agree))
    if agreeing < max(ENOUGH_MATCHES, limits.min_agreeing * len(matches.vertical_px)):
        told = f"{agreeing} of {len(matches.vertical_px)} features agree"
        if fewest < ENOUGH_FEATURES:
            return unsure(FaultKind.VIEW, f"too little texture to judge the cameras: {told}")
        return broken(FaultKind.VIEW, f"the cameras do not see the same scene: {told}")
    return None


def match(left: Gray, right: Gray) -> Matches:
    """Match the features of both images, mutually best ones only."""
    (keys_left, words_left), (keys_right, words_right) = (_features(image) for image in (left, right))
    pairs = []
    if words_left is not None and words_right is not None:
        pairs = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(words_left, words_right)
    places = np.array([keys_left[pair.queryIdx].pt for pair in pairs], dtype=np.float64).reshape(-1, 2)
    moved = np.array([keys_right[pair.trainIdx].pt for pair in pairs], dtype=np.float64).reshape(-1, 2) - places
    return Matches(len(keys_left), len(keys_right), places, moved[:, 1], -moved[:, 0])


def _features(image: Gray) -> tuple[Sequence[cv2.KeyPoint], Gray | None]:
    """Return the corners and their descriptors, (N, 32) or None."""
    least = ABOVE_NOISE * noise_level(image)
    for threshold, enough in FAST_THRESHOLDS:
        keys, words = cv2.ORB_create(FEATURES, fastThreshold=max(threshold, round(least))).detectAndCompute(image, None)
        if len(keys) >= enough:
            break
    return keys, words


@dataclass(frozen=True)
class RowFit:
    """The vertical offset over the image: ``at_centre`` px, and per pixel to the right and down; which matches agree with it, (N,).

    Of each only what is beyond three standard errors: a few features close together tell little of a turn or of a zoom.
    """

    at_centre: float
    per_column: float
    per_row: float
    agree: NDArray[np.bool_]


def fit_rows(matches: Matches, first_guess_px: float) -> RowFit:
    """Fit a plane to the vertical offsets of those matches that agree with most others."""
    vertical = matches.vertical_px
    if len(vertical) < ENOUGH_MATCHES:
        return RowFit(0.0, 0.0, 0.0, np.zeros(len(vertical), dtype=np.bool_))
    agree = np.abs(vertical - _densest(vertical)) <= first_guess_px
    terms = np.column_stack([np.ones(len(vertical)), matches.places - matches.places.mean(axis=0)])
    solution = np.zeros(3)
    for _ in range(FITS):
        if np.count_nonzero(agree) < ENOUGH_MATCHES // 2:
            break
        solution = np.linalg.lstsq(terms[agree], vertical[agree], rcond=None)[0]
        agree = np.abs(vertical - terms @ solution) <= AGREE_PX
    at_centre, per_column, per_row = _beyond_doubt(solution, terms[agree], vertical[agree])
    return RowFit(at_centre, per_column, per_row, agree)


def _beyond_doubt(solution: Floats, terms: Floats, values: Floats) -> tuple[float, float, float]:
    """Return the solution of a least squares fit, each coefficient less three of its standard errors."""
    if len(values) <= ENOUGH_MATCHES // 2:
        return 0.0, 0.0, 0.0
    variance = float(np.sum((values - terms @ solution) ** 2)) / (len(values) - terms.shape[1])
    errors = np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(terms.T @ terms)), 0.0))
    sure = np.sign(solution) * np.maximum(np.abs(solution) - 3.0 * errors, 0.0)
    return float(sure[0]), float(sure[1]), float(sure[2])


def _densest(values: Floats) -> float:
    """Return the middle of the shortest interval that holds a quarter of the values."""
    ordered = np.sort(values)
    quarter = max(2, len(ordered) // 4)
    spans = ordered[quarter - 1 :] - ordered[: len(ordered) - quarter + 1]
    at = int(np.argmin(spans))
    return float(ordered[at : at + quarter].mean())


def _rows_finding(fit: RowFit, shape: tuple[int, ...], limits: ViewLimits) -> Finding | None:
    height, width = shape[:2]
    angle = float(np.degrees(np.arctan(fit.per_column)))
    # The sentence names the greatest of the three; a turn and a zoom are measured where they do least, or noise would be told as one.
    troubles = {
        f"the right image is at least {abs(fit.at_centre):.1f} px off the left one's rows": abs(fit.at_centre),
        f"the cameras are turned against each other by at least {abs(angle):.2f} degrees": abs(fit.per_column) * width / 3.0,
        f"the images differ in scale by at least {abs(fit.per_row):.1%}": abs(fit.per_row) * height / 4.0,
    }
    told = max(troubles, key=lambda trouble: troubles[trouble])
    return broken(FaultKind.CALIBRATION, f"{told}: calibrate the pair") if troubles[told] > limits.max_vertical_px else None


def _disparity_finding(disparity_px: Floats, limits: ViewLimits) -> Finding | None:
    negative = float(np.mean(disparity_px < -1.0))
    if negative > limits.max_negative:
        return broken(FaultKind.CALIBRATION, f"left and right are swapped: {negative:.0%} of the features have a negative disparity")
    if float(np.percentile(np.abs(disparity_px), 95.0)) < limits.min_parallax_px:
        return unsure(FaultKind.VIEW, "no parallax: everything is far away, or both cameras show the same")
    return None


def _covered_finding(left: Gray, right: Gray, offset_px: float) -> Finding | None:
    """Return that a part of one lens is covered: one image has nothing there, where the other one shows content in the same rows.

    A surface at a disparity from infinity's to `REACH` of the width beyond it must be in both, unless it is out of one's view. Both lenses
    covered alike look like a wall without texture.
    """
    content_left, content_right = _content(left), _content(right)
    first = int(np.floor(offset_px * TILES[1] / left.shape[1])) - 1
    disparities = range(first, first + int(np.ceil(REACH * TILES[1])) + 2)
    for side, mine, other, step in (("left", content_left, content_right, 1), ("right", content_right, content_left, -1)):
        # What the left camera sees is as far to the left, or farther, in the right image. Beyond the image any content may be.
        wide = np.pad(mine, ((0, 0), (TILES[1], TILES[1])), constant_values=np.inf)
        starts = [TILES[1] + step * tiles for tiles in disparities]
        nothing = np.all([wide[:, start : start + TILES[1]] < NO_CONTENT for start in starts], axis=0)
        share = float(np.mean(nothing & (other >= CONTENT)))
        if share > COVERED:
            return broken(FaultKind.VIEW, f"the {side} camera sees nothing where the other one does: {share:.0%} of its view is covered")
    return None


def _content(image: Gray) -> Floats:
    """Return the deviation of the grey levels in each tile, noise left out, (rows, columns)."""
    rows, columns = TILES
    size = (columns * TILE_CELLS, rows * TILE_CELLS)
    cells = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.float64)
    return np.asarray(cells.reshape(rows, TILE_CELLS, columns, TILE_CELLS).std(axis=(1, 3)))


def edge_width_px(image: Gray) -> float:
    """Return how wide the strongest edges are: the step over them by their steepest gradient. A sharp image has 3 px, noise or not."""
    smooth = cv2.GaussianBlur(image, (0, 0), 0.7)
    # The Sobel kernel [-1 0 1] spans two pixels.
    gradient = cv2.magnitude(*(cv2.Sobel(smooth, cv2.CV_32F, *axis, ksize=1, scale=0.5) for axis in ((1, 0), (0, 1))))
    strong = gradient >= np.percentile(gradient[::2, ::2], STRONGEST)
    kernel = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), np.uint8)
    step = np.asarray(cv2.subtract(cv2.dilate(smooth, kernel), cv2.erode(smooth, kernel)))
    return float(np.median(step[strong] / np.maximum(gradient[strong], 1e-3)))
