"""What both images together tell of the rig: do the cameras see the same scene, and as a rectified pair does?

Features of both images (ORB) are matched without any knowledge of the geometry. Of a rectified pair, matches lie in one row, and never more
to the right in the right image. A fit of the vertical offset over the image tells a shifted, a turned and a zoomed camera apart.

Where texture repeats (tiles, fences, a chessboard), features are mistaken for each other and few agree. Then they are looked for where a
coarse disparity image puts them, which the smoothness of surfaces keeps from being mistaken; of unrelated images few are found again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import FINE, FaultKind, Finding, broken, unsure
from zed_depth.depth_scale import Landmarks, followed
from zed_depth.stereo import MatcherSettings, coarse_disparity, noise_level

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
ROUND_TRIP_PX = 0.7  # by which a feature that is followed to the other image and back may miss its place
REFINED_PX = (2.0, 1.0)  # along and across the row: by how much the place of a match may change when it is refined
EDGE_PX = 9
TILES = (8, 20)  # rows and columns in which both images are compared for a lens that is partly covered,
TILE_CELLS = 5  # each cut into 5 x 5 averages, which have a third of the pixels' noise or less
CONTENT, NO_CONTENT = 6.0, 2.0  # grey levels, deviation within a tile
REACH = 0.2  # of the width: the farthest that content is looked for
COVERED = 0.08  # of the tiles, without content where the other image has some
OTHER_LIGHT, OTHER_LIGHT_SHARE = 20.0, 0.2  # grey levels and share of the light by which a tile may differ from the other image's
WHITE = 245.0  # grey levels: what is as bright may be brighter
LIGHT_PX = 15  # around a feature: how bright both images are there
COVERED_LIGHT = 0.04  # of the tiles, as bright as nothing there; good pairs have 0.006
STRONGEST = 99.5  # percentile of the gradient: the edges that are looked at


@dataclass(frozen=True)
class ViewLimits:
    """Pixels of the image that is matched, and shares (0..1); measured on real images, see docs/perception.md."""

    max_vertical_px: float = 0.8
    min_agreeing: float = 0.25
    min_followed: float = 0.3
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

    @property
    def fewest(self) -> int:
        """How many features the image with fewer of them has."""
        return min(self.count_left, self.count_right)


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
    first_guess_px = FIRST_GUESS_SHARE * left.shape[0]
    features = _features(left), _features(right)
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
    sure = refine(left, _brighter(right, 1.0 / gain), matches, fit.agree)
    if len(sure.vertical_px) >= ENOUGH_MATCHES:
        fit = replace(fit_rows(sure, first_guess_px), agree=fit.agree)
    # A lens that is partly covered leaves few features, which may seem to be turned: it is looked for first.
    trouble = (
        _covered_finding(left, right, offset_px, gain)
        or _rows_finding(fit, left.shape, limits)
        or _disparity_finding(matches.disparity_px[fit.agree] - offset_px, limits)
    )
    return View(FINE, Landmarks(left, sure.places, sure.disparity_px)) if trouble is None else View(trouble)


def _scene_finding(matches: Matches, fit: RowFit, limits: ViewLimits) -> Finding | None:
    if matches.fewest < FEW_FEATURES:
        return unsure(FaultKind.VIEW, f"too little texture to judge the cameras: {matches.fewest} features")
    agreeing = int(np.count_nonzero(fit.agree))
    if agreeing < max(ENOUGH_MATCHES, limits.min_agreeing * len(matches.vertical_px)):
        told = f"{agreeing} of {len(matches.vertical_px)} features agree"
        if matches.fewest < ENOUGH_FEATURES:
            return unsure(FaultKind.VIEW, f"too little texture to judge the cameras: {told}")
        return broken(FaultKind.VIEW, f"the cameras do not see the same scene: {told}")
    return None


@dataclass(frozen=True)
class Features:
    """Corners of an image, and their descriptors, (N, 32) or None."""

    keys: Sequence[cv2.KeyPoint]
    words: Gray | None

    @property
    def places(self) -> Floats:
        """Columns and rows, (N, 2)."""
        return np.array([key.pt for key in self.keys], dtype=np.float64).reshape(-1, 2)


def match(left: Features, right: Features) -> Matches:
    """Match the features of both images, mutually best ones only."""
    pairs = []
    if left.words is not None and right.words is not None:
        pairs = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(left.words, right.words)
    places = left.places[[pair.queryIdx for pair in pairs]]
    moved = right.places[[pair.trainIdx for pair in pairs]] - places
    return Matches(len(left.keys), len(right.keys), places, moved[:, 1], -moved[:, 0])


def match_by_disparity(left: Gray, right: Gray, keys: Sequence[cv2.KeyPoint], offset_px: float) -> Matches:
    """Return where the corners of the left image are in the right one, looked for from a coarse disparity image on."""
    places = Features(keys, None).places
    coarse = coarse_disparity(MatcherSettings(), left, right, offset_px)
    columns, rows = np.minimum(places.astype(np.intp), [left.shape[1] - 1, left.shape[0] - 1]).T
    guess_px = coarse[rows, columns].astype(np.float64)
    known = np.isfinite(guess_px)
    places, guess_px = places[known], guess_px[known]
    right = _brighter(right, float(left.mean()) / max(1.0, float(right.mean())))
    found = followed(left, right, places, places - np.stack([guess_px, np.zeros_like(guess_px)], axis=1), levels=1)
    seen = np.isfinite(found[:, 0])
    places, found = places[seen], found[seen]
    returned = followed(right, left, found, places, levels=1)
    with np.errstate(invalid="ignore"):  # of those that are not found again
        same = np.hypot(*(returned - places).T) < ROUND_TRIP_PX
    moved = (found - places)[same]
    return Matches(len(keys), len(keys), places[same], moved[:, 1], -moved[:, 0])


def refine(left: Gray, right: Gray, matches: Matches, chosen: NDArray[np.bool_]) -> Matches:
    """Return the chosen matches (N,), less those that can't be found to a fraction of a pixel."""
    places = matches.places[chosen]
    guess = np.stack([-matches.disparity_px[chosen], matches.vertical_px[chosen]], axis=1)
    moved = followed(left, right, places, places + guess, levels=0) - places
    with np.errstate(invalid="ignore"):
        usable = np.all(np.abs(moved - guess) < REFINED_PX, axis=1)
    return Matches(matches.count_left, matches.count_right, places[usable], moved[usable, 1], -moved[usable, 0])


def _features(image: Gray) -> Features:
    """Return the strongest corners of an image."""
    least = ABOVE_NOISE * noise_level(image)
    features = Features((), None)
    for threshold, enough in FAST_THRESHOLDS:
        features = Features(*cv2.ORB_create(FEATURES, fastThreshold=max(threshold, round(least))).detectAndCompute(image, None))
        if len(features.keys) >= enough:
            break
    return features


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


def _gain(left: Gray, right: Gray, matches: Matches, agree: NDArray[np.bool_]) -> float:
    """Return how much brighter the right image is where both show the same."""
    places = matches.places[agree]
    moved = places + np.stack([-matches.disparity_px[agree], matches.vertical_px[agree]], axis=1)
    light = []
    for image, where in ((left, places), (right, moved)):
        columns, rows = np.clip(where, 0, [image.shape[1] - 1, image.shape[0] - 1]).astype(np.intp).T
        light.append(np.asarray(cv2.blur(image, (LIGHT_PX, LIGHT_PX)))[rows, columns].astype(np.float64))
    return float(np.median((light[1] + 1.0) / (light[0] + 1.0)))


def _brighter(image: Gray, gain: float) -> Gray:
    return np.asarray(cv2.convertScaleAbs(image, alpha=gain), dtype=np.uint8)


def _covered_finding(left: Gray, right: Gray, offset_px: float, gain: float) -> Finding | None:
    """Return that a part of one lens is covered: one image has nothing there, where the other one shows content in the same rows.

    A surface at a disparity from infinity's to `REACH` of the width beyond it must be in both, unless it is out of one's view. What covers
    a lens shows less content than the other image, or another light, ``gain`` left out, by which the right image is the brighter one. Both
    lenses covered alike look like a wall without texture.
    """
    tiles_left, tiles_right = Tiles.of(left), Tiles.of(right)
    columns = TILES[1]
    first = int(np.floor(offset_px * columns / left.shape[1])) - 1
    disparities = range(first, first + int(np.ceil(REACH * columns)) + 2)
    sides = (("left", tiles_left, tiles_right, 1, gain), ("right", tiles_right, tiles_left, -1, 1.0 / gain))
    other_light = 0.0
    for side, mine, other, step, brighter in sides:
        # What the left camera sees is as far to the left, or farther, in the right image.
        starts = [columns + step * tiles for tiles in disparities]
        nothing = np.all(_in_reach(mine.content, starts, beyond=np.inf) < NO_CONTENT, axis=0) & (other.content >= CONTENT)
        borne = OTHER_LIGHT + OTHER_LIGHT_SHARE * other.light
        brightest = np.where(mine.brightest >= WHITE, np.inf, brighter * mine.brightest)
        darkest = np.minimum(brighter * mine.darkest, WHITE)
        mine_is_darker = other.light > _in_reach(brightest, starts, beyond=np.inf).max(axis=0) + borne
        mine_is_brighter = other.light < _in_reach(darkest, starts, beyond=-np.inf).min(axis=0) - borne
        without_content = float(np.mean(nothing))
        if without_content > COVERED:
            told = f"the {side} camera sees nothing where the other one does: {without_content:.0%} of its view is covered"
            return broken(FaultKind.VIEW, told)
        other_light = max(other_light, float(np.mean(mine_is_darker | mine_is_brighter)))
    if other_light > COVERED_LIGHT:
        return broken(FaultKind.VIEW, f"a lens is partly covered: {other_light:.0%} of the view is much darker or brighter in one image")
    return None


def _in_reach(values: Floats, starts: Sequence[int], *, beyond: float) -> Floats:
    """Return what those tiles have that may show the same as a tile of the other image, (disparities, rows, columns)."""
    columns = values.shape[1]
    wide = np.pad(values, ((0, 0), (columns, columns)), constant_values=beyond)
    return np.stack([wide[:, start : start + columns] for start in starts])


@dataclass(frozen=True)
class Tiles:
    """What an image shows tile by tile, (rows, columns) each, noise averaged out; grey levels.

    ``light`` is the mean, ``content`` the deviation, ``darkest`` and ``brightest`` are the extremes of the tile's cells.
    """

    light: Floats
    content: Floats
    darkest: Floats
    brightest: Floats

    @classmethod
    def of(cls, image: Gray) -> Tiles:
        """Cut an image into tiles."""
        rows, columns = TILES
        size = (columns * TILE_CELLS, rows * TILE_CELLS)
        means = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.float64)
        cells, within = means.reshape(rows, TILE_CELLS, columns, TILE_CELLS), (1, 3)
        return cls(cells.mean(axis=within), cells.std(axis=within), cells.min(axis=within), cells.max(axis=within))


def edge_width_px(image: Gray) -> float:
    """Return how wide the strongest edges are: the step over them by their steepest gradient. A sharp image has 3 px, noise or not."""
    smooth = cv2.GaussianBlur(image, (0, 0), 0.7)
    # The Sobel kernel [-1 0 1] spans two pixels.
    gradient = cv2.magnitude(*(cv2.Sobel(smooth, cv2.CV_32F, *axis, ksize=1, scale=0.5) for axis in ((1, 0), (0, 1))))
    strong = gradient >= np.percentile(gradient[::2, ::2], STRONGEST)
    kernel = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), np.uint8)
    step = np.asarray(cv2.subtract(cv2.dilate(smooth, kernel), cv2.erode(smooth, kernel)))
    return float(np.median(step[strong] / np.maximum(gradient[strong], 1e-3)))
