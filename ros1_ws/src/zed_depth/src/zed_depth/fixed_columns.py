"""Steps that stand in the same column of both images are made by the camera, or by the way of its bytes: no scene has them.

What is near stands farther to the left in the right image. What is so far away that it does not is never as high as the image. Steps in the
same column are the seam of images that were displaced by some bytes, dead columns, and the blocks of a strong compression.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import FINE, FaultKind, Finding, broken

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]

EVERY_ROW = 4
BESIDE = (-3, -2, 2, 3)  # columns beside a step, where the image changes by less than ...
STEEPER = 0.5  # ... so much of the step,
STEP = 6  # that is higher than so many grey levels besides
MOST_ROWS = 0.5  # with a step in the same column of both images; good photographs have a fifth at most, a far forest 0.43


def fixed_columns_finding(left: Gray, right: Gray) -> Finding:
    """Return whether images (h, w), as the cameras sent them, have steps in the same column."""
    if left.shape != right.shape or left.shape[1] <= 2 * max(BESIDE) + 1:
        return FINE
    share = np.minimum(_steps(left), _steps(right))
    column = int(np.argmax(share))
    if share[column] <= MOST_ROWS:
        return FINE
    told = f"both images have a step in column {column + 1}, in {share[column]:.0%} of the rows"
    return broken(FaultKind.FORMAT, f"{told}: bytes are lost, columns dead or the compression is too strong")


def _steps(image: Gray) -> NDArray[np.float64]:
    """Return the share of the rows that have a step from a column to the next one, (w - 1,); none at the margins."""
    change = np.asarray(cv2.absdiff(image[::EVERY_ROW, 1:], image[::EVERY_ROW, :-1]))
    margin = max(BESIDE)
    inner = change[:, margin:-margin]
    beside = reduce(np.maximum, (change[:, margin + k : change.shape[1] - margin + k] for k in BESIDE))
    steep = cv2.compare(cv2.subtract(inner, np.full_like(inner, STEP)), cv2.multiply(beside, 1.0 / STEEPER), cv2.CMP_GT)
    shares = np.asarray(cv2.reduce(steep, 0, cv2.REDUCE_AVG, dtype=cv2.CV_64F)).ravel() / 255.0
    return np.pad(shares, margin)
