"""What both images together tell of the rig: do the cameras see the same scene, and as a rectified pair does?

Features of both images (ORB) are matched without any knowledge of the geometry. Of a rectified pair, matches lie in one row, and never more
to the right in the right image. A fit of the vertical offset over the image tells a shifted, a turned and a zoomed camera apart.

Where texture repeats (tiles, fences, a chessboard), features are mistaken for each other and few agree. Then they are looked for where a
coarse disparity image puts them, which the smoothness of surfaces keeps from being mistaken; of unrelated images few are found again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import FINE, FaultKind, Finding, broken, unsure
from zed_depth.covered_lens import covered_finding
from zed_depth.feature_motion import Landmarks
from zed_depth.features import Matches, brighter, features_of, match, match_by_disparity, refine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]
    Floats = NDArray[np.float64]

FEW_FEATURES = 60
ENOUGH_FEATURES = 120
ENOUGH_MATCHES = 20
AGREE_PX = 2.0
FEW_MISTAKEN = 3  # features that may be mistaken for others in the same row
FIRST_GUESS_SHARE = 0.03  # of the height: by as much the rows of a camera that is off may differ over the image
FITS = 4
MOVED = "a camera has moved (calibrate the pair)"
MOVED_ASIDE = "a camera has turned aside (calibrate the pair)"
SWAPPED = "left and right are swapped, as both images are when they are mirrored or upside down"
NO_TEXTURE = "what is in view has none", "fog, dirt or the exposure takes it"
NOT_THE_SAME = "one image is much older than the other or spoilt in its transfer", "one of them is mirrored, turned or covered"
EDGE_PX = 9
LIGHT_PX = 15  # around a feature: how bright both images are there
STRONGEST = 99.5  # percentile of the gradient: the edges that are looked at


@dataclass(frozen=True)
class ViewLimits:
    """Pixels of the image that is matched, and shares (0..1); measured on real images, docs/experiments/perception.md.

    Of the features ``max_negative`` have a negative disparity where the cameras are swapped, ``max_beyond`` one of less than -``beyond_px``
    where one of them is turned aside: what is far away seems to be beyond infinity.
    """

    max_vertical_px: float = 0.8
    min_agreeing: float = 0.25
    min_followed: float = 0.3
    max_negative: float = 0.5
    max_beyond: float = 0.05
    beyond_px: float = 0.7
    min_parallax_px: float = 0.5
    max_edge_px: float = 6.0


@dataclass(frozen=True)
class View:
    """What both images together tell: the finding; the features in which they agree, and the right image by the left one's light.

    These are there where the cameras see the same and their rows are right, though one of them be turned aside.
    """

    finding: Finding
    landmarks: Landmarks | None = None
    right: Gray | None = None


def view_of(left: Gray, right: Gray, *, offset_px: float, limits: ViewLimits) -> View:
    """Hold both images of a rectified pair against each other; ``offset_px`` is the disparity of infinity."""
    for side, image in (("left", left), ("right", right)):
        width_px = edge_width_px(image)
        if width_px > limits.max_edge_px:
            told = f"{side} image is blurred, its sharpest edges are {width_px:.1f} px wide"
            return View(broken(FaultKind.BLUR, told, "the lens is out of focus", "dirt, drops or motion while it was exposed"))
    if np.array_equal(left, right):
        return View(
            broken(FaultKind.VIEW, "both cameras deliver the same image", "one of them is sent on both topics", "the driver repeats it")
        )
    first_guess_px = FIRST_GUESS_SHARE * left.shape[0]
    features = features_of(left), features_of(right)
    matches = match(*features)
    fit = fit_rows(matches, first_guess_px)
    trouble = _scene_finding(matches, fit, limits)
    if trouble is not None and matches.fewest >= FEW_FEATURES:
        along = match_by_disparity(left, right, features[0].keys, offset_px)
        fit_along = fit_rows(along, first_guess_px)
        if np.count_nonzero(fit_along.agree) >= max(ENOUGH_MATCHES, limits.min_followed * along.count_left):
            matches, fit, trouble = along, fit_along, None
    if trouble is not None:
        return View(trouble)
    gain = _gain(left, right, matches, fit.agree)
    # A feature is followed by its light: as bright as in the left image.
    lit = brighter(right, 1.0 / gain)
    sure = refine(left, lit, matches, fit.agree)
    matched_px = disparity_px = matches.disparity_px[fit.agree] - offset_px
    if len(sure.vertical_px) >= ENOUGH_MATCHES:
        fit = fit_rows(sure, first_guess_px)
        disparity_px = sure.disparity_px[fit.agree] - offset_px if np.any(fit.agree) else matched_px
    # A lens that is partly covered leaves few features, which may seem to be turned: it is looked for first.
    trouble = (
        covered_finding(left, right, offset_px, gain) or _rows_finding(fit, left.shape, limits) or _parallax_finding(matched_px, limits)
    )
    if trouble is not None:
        return View(trouble)
    return View(_beyond_finding(disparity_px, limits) or FINE, Landmarks(left, sure.places, sure.disparity_px), lit)


def _scene_finding(matches: Matches, fit: RowFit, limits: ViewLimits) -> Finding | None:
    if matches.fewest < FEW_FEATURES:
        return unsure(FaultKind.VIEW, f"too little texture to judge the cameras, {matches.fewest} features", *NO_TEXTURE)
    agreeing = int(np.count_nonzero(fit.agree))
    if agreeing < max(ENOUGH_MATCHES, limits.min_agreeing * len(matches.vertical_px)):
        told = f"{agreeing} of {len(matches.vertical_px)} features agree"
        if matches.fewest < ENOUGH_FEATURES:
            return unsure(FaultKind.VIEW, f"too little texture to judge the cameras, {told}", *NO_TEXTURE)
        return broken(FaultKind.VIEW, f"the cameras do not see the same scene, {told}", *NOT_THE_SAME)
    return None


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
    # Of a vehicle that moves, an image that is late is turned, moved and scaled, too.
    late = "one image is older than the other (look at the synchronisation)"
    return broken(FaultKind.CALIBRATION, told, MOVED, late) if troubles[told] > limits.max_vertical_px else None


def _parallax_finding(matched_px: Floats, limits: ViewLimits) -> Finding | None:
    """Judge disparities of matched features (N,), from infinity on."""
    negative = float(np.mean(matched_px < -1.0))
    if negative > limits.max_negative:
        told = f"{negative:.0%} of the features have a negative disparity"
        far, middle, near = np.percentile(matched_px, (5.0, 50.0, 95.0))
        # Of a pair that is swapped the few that are near are the most negative, of cameras that are turned aside the least.
        turned = near - middle > 2.0 * (middle - far) + 1.0
        causes = (MOVED_ASIDE, SWAPPED) if turned else (SWAPPED, MOVED_ASIDE)
        return broken(FaultKind.CALIBRATION, told, *causes)
    if float(np.percentile(np.abs(matched_px), 95.0)) < limits.min_parallax_px:
        return unsure(FaultKind.VIEW, "no parallax", "everything is far away", "both cameras show the same")
    return None


def _beyond_finding(refined_px: Floats, limits: ViewLimits) -> Finding | None:
    """Judge disparities (N,) that are known to a fraction of a pixel, from infinity on."""
    beyond = np.count_nonzero(refined_px < -limits.beyond_px)
    if beyond <= max(FEW_MISTAKEN, limits.max_beyond * len(refined_px)):
        return None
    told = f"the cameras are turned aside against each other: {beyond} of {len(refined_px)} features seem to be beyond infinity"
    return broken(FaultKind.CALIBRATION, told, MOVED, "an image is moved to the side in its transfer")


def _gain(left: Gray, right: Gray, matches: Matches, agree: NDArray[np.bool_]) -> float:
    """Return how much brighter the right image is where both show the same."""
    places = matches.places[agree]
    moved = places + np.stack([-matches.disparity_px[agree], matches.vertical_px[agree]], axis=1)
    light = []
    for image, where in ((left, places), (right, moved)):
        columns, rows = np.clip(where, 0, [image.shape[1] - 1, image.shape[0] - 1]).astype(np.intp).T
        light.append(np.asarray(cv2.blur(image, (LIGHT_PX, LIGHT_PX)))[rows, columns].astype(np.float64))
    return float(np.median((light[1] + 1.0) / (light[0] + 1.0)))


def edge_width_px(image: Gray) -> float:
    """Return how wide the strongest edges are: the step over them by their steepest gradient. A sharp image has 3 px, noise or not."""
    smooth = cv2.GaussianBlur(image, (0, 0), 0.7)
    # The Sobel kernel [-1 0 1] spans two pixels.
    gradient = cv2.magnitude(*(cv2.Sobel(smooth, cv2.CV_32F, *axis, ksize=1, scale=0.5) for axis in ((1, 0), (0, 1))))
    strong = gradient >= np.percentile(gradient[::2, ::2], STRONGEST)
    kernel = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), np.uint8)
    step = np.asarray(cv2.subtract(cv2.dilate(smooth, kernel), cv2.erode(smooth, kernel)))
    return float(np.median(step[strong] / np.maximum(gradient[strong], 1e-3)))
