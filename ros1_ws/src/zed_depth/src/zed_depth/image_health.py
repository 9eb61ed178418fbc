"""The health of a camera by single images: exposure, content, change. Cheap enough for every pair."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import FINE, FaultKind, Finding, broken, unsure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zed_depth.pairing import StereoPair

    Gray = NDArray[np.uint8]

THUMB = 8  # pixels of the image averaged into one: noise of 8 grey levels has 1 there, content keeps its contrast
SATURATED = 250
STRIDE = 3
EMPTY_ROWS = 0.15  # of the image, of one grey level each: margins of a rectified image may be; a sky is white where it is
SHARPNESS_FELL = 0.6  # from image to image of a good camera it falls to 0.9 at most


@dataclass(frozen=True)
class ImageLimits:
    """Grey levels (0..255) and shares (0..1); measured on real images, docs/experiments/perception.md.

    ``min_contrast``: deviation of the averaged image; a dark image (mean below ``dark_mean``) needs twice as much. ``min_changed``: share
    of the pixels that differ from the image before; noise alone changes most of them.
    """

    dark_mean: float = 20.0
    min_contrast: float = 4.0
    max_saturated: float = 0.6
    min_changed: float = 0.001


class ImageJudge:
    """Judge the pairs of one camera in their order; not thread-safe."""

    def __init__(self, limits: ImageLimits) -> None:
        self._limits = limits
        self._previous: dict[str, Gray] = {}
        self._blank: set[str] = set()  # the sides of the last pair that are lit, but show nothing
        self.sharpness = 0.0
        """Mean second derivative of the less sharp image of the last pair, grey levels; to be compared among images of one scene only."""

    def finding(self, pair: StereoPair) -> Finding:
        """Return the finding about the images of this pair; call it once for each pair."""
        sides = (("left", pair.left), ("right", pair.right))
        self.sharpness = min(_sharpness(image) for _, image in sides)
        self._blank.clear()
        findings = [self._one(side, image) for side, image in sides]
        if len(self._blank) == len(sides):
            return unsure(FaultKind.EXPOSURE, "both images are blank", "a surface without texture", "covered lenses")
        return next((finding for finding in findings if not finding.ok), FINE)

    def _one(self, side: str, image: Gray) -> Finding:
        sample = np.ascontiguousarray(image[::STRIDE, ::STRIDE])
        previous, self._previous[side] = self._previous.get(side), sample
        limits = self._limits
        rows, columns = (max(1, length // THUMB) for length in image.shape)
        # Whole blocks: OpenCV takes twenty times as long to average fractions of pixels.
        thumb = np.asarray(cv2.resize(image[: rows * THUMB, : columns * THUMB], (columns, rows), interpolation=cv2.INTER_AREA))
        mean, contrast = float(thumb.mean()), float(thumb.std())
        saturated = np.count_nonzero(sample >= SATURATED) / sample.size
        empty = float(np.mean((sample.max(axis=1) == sample.min(axis=1)) & (sample[:, 0] < SATURATED)))
        told = f"mean {mean:.0f}, contrast {contrast:.1f} of 255"
        if saturated > limits.max_saturated:
            return broken(
                FaultKind.EXPOSURE, f"{side} image is overexposed, {saturated:.0%} of it is white", "too much light", "exposure too long"
            )
        if mean < limits.dark_mean and contrast < 2.0 * limits.min_contrast:
            return broken(FaultKind.EXPOSURE, f"{side} image is dark ({told})", "too little light", "a covered lens")
        if previous is not None and previous.shape == sample.shape:
            changed = np.count_nonzero(previous != sample) / sample.size
            if changed < limits.min_changed:
                told = f"{side} image is frozen, {changed:.2%} of its pixels have changed"
                return broken(FaultKind.FROZEN, told, "the driver repeats it", "its encoding is another one than it says")
        if contrast < limits.min_contrast:
            self._blank.add(side)
            return broken(FaultKind.EXPOSURE, f"{side} image is blank ({told})", "a covered lens", "wrong exposure or encoding")
        if empty > EMPTY_ROWS:
            told = f"a part of the {side} image is missing, {empty:.0%} of its rows have one grey level only"
            return broken(FaultKind.FORMAT, told, "rows are lost in the transfer", "the driver cuts the image")
        return FINE


def _sharpness(image: Gray) -> float:
    """Return the mean second derivative of every second row."""
    return float(cv2.norm(cv2.Laplacian(image[::2], cv2.CV_16S), cv2.NORM_L1)) / max(1, image[::2].size)
