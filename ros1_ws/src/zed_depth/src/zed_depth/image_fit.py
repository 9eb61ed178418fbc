"""Do both images fit each other at the depths that were measured? Whatever makes them differ, wrong depths are what it does.

Around each pixel with texture the right image, taken from where the disparity says, must look like the left one, but for their light. A rig
whose rows are off, an image that is torn, half old, noisy, compressed to blocks or brighter than white still has disparities, but what they
join looks different. What is nearer than the range is left out: it is told at the near limit, where it does not match.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import FINE, FaultKind, Finding, broken

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]
    Pixels = NDArray[np.float32]
    Mask = NDArray[np.bool_]

EVERY_ROW = 2
PATCH = (7, 5)  # columns, and rows of those that are looked at
TEXTURE = 6.0  # grey levels: deviation within a patch ...
ABOVE_NOISE, MOST_NOISE = 3.0, 5.0  # ... and of the noise, which counts up to so many grey levels: what has more is no good camera
ALIKE = 0.7  # correlation of two patches that show the same
UNSEEN = 0.1  # of the width, at the left: the right camera does not see what is near there
NEAR_PATCH = (41, 21)  # around what is nearer than the range, where the matcher is led astray
MOST_NEAR = 0.25  # of the image; with more that is near there is too little else
LEAST_TEXTURE = 0.03  # of the image, or of a half of it
FIT, KNOWN_FIT = 0.55, 0.77  # of what has texture, and of what has a depth, too; good pairs have 0.62 and 0.84 at least
UNFIT = "parts are lost, old or compressed in the transfer", "exposure, noise or blur of one camera"
HALF_FIT, HALF_KNOWN_FIT = 0.3, 0.6  # of the upper or lower half both must be less: beside what is near, much of a half has no depth


@dataclass(frozen=True)
class Fit:
    """The finding of a pair, and why what is not seen in it must not be taken for free though it is no finding, or nothing."""

    finding: Finding
    doubt: str = ""


def fit_of(disparity_px: Pixels, left: Gray, right: Gray, *, last_px: float, noise: float, incomparable: Mask | None = None) -> Fit:
    """Return whether the images fit at the disparities (h, w) of the left one; ``last_px`` is the near limit, ``noise`` in grey levels.

    ``incomparable`` (h, w) are pixels that a raw image does not show: the repeated border there is no texture.
    Where a half of the image does not fit, it is old, or missing, or the vehicle stands on the ground, nearer than can be seen: a doubt.
    """
    pixels = disparity_px[::EVERY_ROW]
    near = pixels >= last_px
    if np.mean(near) > MOST_NEAR:
        return Fit(FINE)
    textured, alike = _compared(pixels, left[::EVERY_ROW], right[::EVERY_ROW], noise)
    textured &= cv2.dilate(near.astype(np.uint8), np.ones(NEAR_PATCH[::-1], np.uint8)) == 0
    textured[:, : int(UNSEEN * textured.shape[1])] = False
    if incomparable is not None:
        textured &= ~incomparable[::EVERY_ROW]
    known = textured & np.isfinite(pixels)
    share, known_share = _shares(textured, known, alike)
    if share < FIT or known_share < KNOWN_FIT:
        told = f"{share:.0%} of what has texture looks alike in both, {known_share:.0%} of what has a depth"
        return Fit(broken(FaultKind.VIEW, f"the images do not fit each other, {told}", *UNFIT))
    half = len(pixels) // 2
    for name, rows in (("upper", slice(None, half)), ("lower", slice(half, None))):
        share, known_share = _shares(textured[rows], known[rows], alike[rows])
        if share < HALF_FIT and known_share < HALF_KNOWN_FIT:
            return Fit(FINE, f"the {name} halves of the images do not fit each other: {share:.0%} of what has texture looks alike in both")
    return Fit(FINE)


def _shares(textured: Mask, known: Mask, alike: Mask) -> tuple[float, float]:
    """Return which share of what has texture, and of what has a depth, too, looks alike in both images; 1 where there is too little."""
    count, of_known = np.count_nonzero(textured), np.count_nonzero(known)
    if count < LEAST_TEXTURE * textured.size:
        return 1.0, 1.0
    fitting = np.count_nonzero(known & alike)
    return fitting / count, fitting / max(1, of_known)


def _compared(pixels: Pixels, left: Gray, right: Gray, noise: float) -> tuple[Mask, Mask]:
    """Return where the left image (h, w) has texture, and where the right one looks alike at the disparities, but for the light."""
    rows, columns = np.indices(left.shape, dtype=np.float32)
    moved = cv2.remap(right, columns - np.nan_to_num(pixels), rows, cv2.INTER_LINEAR).astype(np.float32)
    seen = left.astype(np.float32)
    seen_mean, moved_mean = _mean(seen), _mean(moved)
    seen_variance = _mean(seen * seen) - seen_mean * seen_mean
    moved_variance = _mean(moved * moved) - moved_mean * moved_mean
    covariance = _mean(seen * moved) - seen_mean * moved_mean
    textured: Mask = seen_variance > TEXTURE**2 + (ABOVE_NOISE * min(noise, MOST_NOISE)) ** 2
    alike: Mask = (covariance > 0.0) & (covariance * covariance > ALIKE**2 * seen_variance * moved_variance)
    return textured, alike


def _mean(values: Pixels) -> Pixels:
    mean: Pixels = cv2.boxFilter(values, -1, PATCH)
    return mean
