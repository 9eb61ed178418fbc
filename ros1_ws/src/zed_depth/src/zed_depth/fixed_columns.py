"""Steps that stand in the same column of both images are made by the camera, or by the way of its bytes: no edge of a scene stands so.

What is near stands farther to the left in the right image. What is so far away that it does not is never as high as the image. Steps in the
same column are the seam of images that were displaced by some bytes, dead columns, and the blocks of a strong compression. Where two edges
of posts happen to meet in a column, each is in the other image, too, moved by its disparity, with the same surface beside it.
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
    Shares = NDArray[np.float64]

EVERY_ROW = 4
BESIDE = (-3, -2, 2, 3)  # columns beside a step, where the image changes by less than ...
STEEPER = 0.5  # ... so much of the step,
STEP = 6  # that is higher than so many grey levels besides
MOST_ROWS = 0.5  # with a step in the same column of both images; good photographs have a fifth at most, a far forest 0.43
MANY = 1.0 / 16.0  # of all columns, half of a grid of 8: what makes so many steps is not a scene that happens to
STRIP = 4  # columns beside a step that are compared; also the least disparity: what is thinner than this has no steep steps
AS_STEP = 0.6  # of the rows that an edge is a step in, in the other image
ALIKE = 0.85  # correlation of strips: of edges of scenes 0.87 to 1, beside the seam of displaced images 0.67, once of 80 0.89


def fixed_columns_finding(left: Gray, right: Gray) -> Finding:
    """Return whether images (h, w), as the cameras sent them, have steps in the same column."""
    if left.shape != right.shape or left.shape[1] <= 2 * max(BESIDE) + 1:
        return FINE
    steps_left, steps_right = _steps(left), _steps(right)
    share = np.minimum(steps_left, steps_right)
    suspects = np.flatnonzero(share > MOST_ROWS)
    if len(suspects) < MANY * left.shape[1]:
        here, there = (left, steps_left), (right, steps_right)
        suspects = suspects[[not (_is_edge(c, *here, *there) or _is_edge(c, *there, *here, mirrored=True)) for c in suspects]]
    if not suspects.size:
        return FINE
    column = suspects[np.argmax(share[suspects])]
    told = f"both images have a step in column {column + 1}, in {share[column]:.0%} of the rows"
    return broken(FaultKind.FORMAT, told, "bytes are lost or columns are dead", "the compression is too strong")


def _is_edge(column: int, image: Gray, steps: Shares, other: Gray, steps_there: Shares, *, mirrored: bool = False) -> bool:
    """Return whether the step after a column of an image stands in the other one, too, farther left, beside the same surface.

    ``mirrored``: farther right, as what the right image shows does in the left one.
    """
    if mirrored:
        column, image, other = len(steps) - 1 - column, image[:, ::-1], other[:, ::-1]
        steps, steps_there = steps[::-1], steps_there[::-1]
    for moved in range(STRIP, column - STRIP + 1):
        around = steps_there[column - moved - 1 : column - moved + 2]
        there = column - moved - 1 + int(np.argmax(around))
        if around.max() < AS_STEP * steps[column]:
            continue
        for begin in (1 - STRIP, 1):  # the strip to the left of the step, and the one to the right
            if _correlation(image[:, column + begin :][:, :STRIP], other[:, there + begin :][:, :STRIP]) > ALIKE:
                return True
    return False


def _correlation(one: Gray, other: Gray) -> float:
    """Return how alike two patches are, -1 to 1; 0 for one without any texture."""
    a, b = (patch - patch.mean(dtype=np.float32) for patch in (one.astype(np.float32), other.astype(np.float32)))
    energy = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return float(np.sum(a * b)) / energy if energy > 0.0 else 0.0


def _steps(image: Gray) -> Shares:
    """Return the share of the rows that have a step from a column to the next one, (w - 1,); none at the margins."""
    change = np.asarray(cv2.absdiff(image[::EVERY_ROW, 1:], image[::EVERY_ROW, :-1]))
    margin = max(BESIDE)
    inner = change[:, margin:-margin]
    beside = reduce(np.maximum, (change[:, margin + k : change.shape[1] - margin + k] for k in BESIDE))
    steep = cv2.compare(cv2.subtract(inner, np.full_like(inner, STEP)), cv2.multiply(beside, 1.0 / STEEPER), cv2.CMP_GT)
    shares = np.asarray(cv2.reduce(steep, 0, cv2.REDUCE_AVG, dtype=cv2.CV_64F)).ravel() / 255.0
    return np.pad(shares, margin)
