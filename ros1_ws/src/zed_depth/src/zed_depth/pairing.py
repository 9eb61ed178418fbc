"""Left and right images to pairs, and whether a pair is fit to be used: of one moment, not black, not frozen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import NS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]


@dataclass(frozen=True)
class StereoPair:
    """Two rectified grey images of one moment."""

    stamp_ns: int
    left: Gray
    right: Gray


class Pairing:
    """Join the newest left with the newest right image when their stamps agree; not thread-safe."""

    def __init__(self, *, tolerance_s: float) -> None:
        self._tolerance_ns = int(tolerance_s * NS)
        self._newest: dict[str, tuple[int, Gray]] = {}

    def add(self, side: str, stamp_ns: int, image: Gray) -> StereoPair | None:
        """Take an image of the side ``left`` or ``right``; return the pair that it completes. Each image is used once."""
        self._newest[side] = (stamp_ns, image)
        if len(self._newest) < 2:
            return None
        (left_ns, left), (right_ns, right) = self._newest["left"], self._newest["right"]
        if abs(left_ns - right_ns) > self._tolerance_ns:
            return None
        self._newest.clear()
        return StereoPair(stamp_ns=left_ns, left=left, right=right)

    def apart_s(self) -> float:
        """Return by how much the stamps of two images that wait for each other differ; 0 when fewer than two wait."""
        if len(self._newest) < 2:
            return 0.0
        return abs(self._newest["left"][0] - self._newest["right"][0]) / NS


@dataclass(frozen=True)
class ImageLimits:
    """Grey levels (0..255): a mean or a spread below these is no picture."""

    min_mean: float = 4.0
    min_std: float = 2.0


class PairJudge:
    """Find what is wrong with a pair; not thread-safe.

    A sensor's image is never the same twice, noise sees to that. One repeated image may be a driver's hiccup, so repetition is only a
    complaint here: it does not refresh the health watch, whose timeout of 0.35 s at 10 Hz then means three repetitions.
    """

    def __init__(self, limits: ImageLimits) -> None:
        self._limits = limits
        self._previous: StereoPair | None = None

    def complaint(self, pair: StereoPair) -> str:
        """Return why the pair is of no use, or an empty text; call it once for each pair, in order."""
        previous, self._previous = self._previous, pair
        for side, image in (("left", pair.left), ("right", pair.right)):
            mean, std = cv2.meanStdDev(image)
            if mean[0, 0] < self._limits.min_mean or std[0, 0] < self._limits.min_std:
                return f"{side} image is black or blank (mean {mean[0, 0]:.1f}, deviation {std[0, 0]:.1f})"
        if previous is not None:
            for side, image, before in (("left", pair.left, previous.left), ("right", pair.right, previous.right)):
                if np.array_equal(image, before):
                    return f"{side} image is frozen"
        return ""
