"""Is a part of an image old? A transfer that ends early leaves the rest of an earlier image in the buffer, in both cameras alike.

Such halves fit each other, so no comparison of left and right tells. What tells is:

- Rows that are, byte by byte, those of an earlier image. No camera takes the same row twice: it has noise.
- The seam between both parts. What two neighbouring rows show is alike everywhere else; there it is not, in both images in the same row.
  An edge of the scene may lie in a row, too. But it leaves that row when the image moves up or down, and a seam does not.
"""

from __future__ import annotations

import zlib
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import FINE, FaultKind, Finding, broken

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from zed_depth.pairing import StereoPair

    Gray = NDArray[np.uint8]
    Floats = NDArray[np.float32]

ROWS_APART = 8  # of the rows that are held against earlier ones
PAIRS = 8  # that are remembered
LEAST_DEVIATION = 3.0  # grey levels along a row; with less it is white, black, or a surface without texture
LOST = "rows are lost in the transfer", "the driver overwrites an image while it is sent"
CHANGED = 4.0  # grey levels, on the average of the other rows: what stands still may look the same twice after a compression
LEAST_SAME = 0.1  # of the rows that have texture: so many are those of one earlier image
COLUMNS_APART = 4  # of the columns that are compared from row to row
MEAN_PX = 9  # of these columns: what is wider is no texture
SEAM = 0.25  # correlation of a row with the next one, over the seam
BESIDE = 0.4  # by which that is less than beside the seam
MOVED_PX = 5.0  # up or down, from image to image in which a seam stays in its row, and ...
LEAST_SEEN = 5  # pairs that show it
MOST_MOVED_PX = 8
BAND = 40  # rows above a seam, by which the image's motion is told
SURELY = 0.7  # of what differs without the motion, less must differ with it
FORGOTTEN = 3  # pairs without the seam


class TornJudge:
    """Judge the pairs of one camera in their order; not thread-safe."""

    def __init__(self) -> None:
        self._earlier: dict[str, deque[tuple[dict[int, int], NDArray[np.int16]]]] = {}  # checksums of rows, and some pixels of these
        self._profile: Floats | None = None
        self._suspected: dict[int, Suspect] = {}  # by row
        self._proved: set[int] = set()

    def finding(self, pair: StereoPair) -> Finding:
        """Return whether parts of the images are old; call it once for each pair."""
        images = {"left": pair.left, "right": pair.right}
        repeated = [self._repeated(side, image) for side, image in images.items()]
        for side, image, row in zip(images, images.values(), repeated, strict=True):
            if row is not None:
                self._prove(image, row)
                return broken(FaultKind.VIEW, f"a part of the {side} image is that of an earlier one, from row {row} on or up to it", *LOST)
        row = self._seam(pair)
        return (
            FINE if row is None else broken(FaultKind.VIEW, f"a part of the images is old, what they show breaks off at row {row}", *LOST)
        )

    def _repeated(self, side: str, image: Gray) -> int | None:
        """Return the first row from which on, or the last one up to which, an image is an earlier one, or None."""
        known = self._earlier.setdefault(side, deque(maxlen=PAIRS))
        sample = image[::ROWS_APART]
        thin = np.asarray(sample[:, ::COLUMNS_APART], dtype=np.int16)
        sums = {int(k): zlib.crc32(sample[k].tobytes()) for k in np.flatnonzero(thin.std(axis=1) > LEAST_DEVIATION)}
        found = None
        for earlier_sums, earlier in known:
            same = [k for k, value in sums.items() if earlier_sums.get(k) == value]
            if not LEAST_SAME * len(sums) < len(same) < (1.0 - LEAST_SAME) * len(sums) or earlier.shape != thin.shape:
                continue
            others = sorted(set(sums) - set(same))
            if np.abs(thin[others] - earlier[others]).mean() > CHANGED:
                found = ROWS_APART * (same[0] if same[0] > min(sums) else same[-1])
        known.append((sums, thin))
        return found

    def _prove(self, image: Gray, row: int) -> None:
        alike = likeness(image)
        rows = slice(max(0, row - 2 * ROWS_APART), row + 2 * ROWS_APART)
        if len(alike[rows]):
            self._proved.add(rows.start + int(np.argmin(alike[rows])))

    def _seam(self, pair: StereoPair) -> int | None:
        """Return a row at which both images break off, and which is no edge of the scene, or None."""
        alike = likeness(pair.left)
        rows = {int(row) for row in np.flatnonzero(_breaks(alike))}
        known = {row for row in self._proved if row < len(alike) and alike[row] < SEAM}
        if rows or known:
            other = likeness(pair.right)
            rows = {row for row in rows if other.shape == alike.shape and _breaks(other)[row]}
            known = {row for row in known if other.shape == alike.shape and other[row] < SEAM}
        profile, before = _profile(pair.left), self._profile
        self._profile = profile
        for row in set(self._suspected) | rows:
            suspect = self._suspected.setdefault(row, Suspect())
            suspect.take(row in rows, _moved_px(before, profile, row))
            if suspect.absent >= FORGOTTEN:
                del self._suspected[row]
            elif row in rows and suspect.moved_px >= MOVED_PX and suspect.seen >= LEAST_SEEN:
                self._proved.add(row)
                known.add(row)
        return min(known, default=None)


@dataclass
class Suspect:
    """A row that may be a seam: the pairs that broke off there, how far the image moved from one of them to the next, pairs without it."""

    seen: int = 0
    moved_px: float = 0.0
    absent: int = 0

    def take(self, breaks_off: bool, moved_px: float) -> None:  # noqa: FBT001 -- what a pair tells
        """Store the finding about a pair."""
        if breaks_off:
            self.moved_px += moved_px if self.seen and not self.absent else 0.0
            self.seen += 1
        self.absent = 0 if breaks_off else self.absent + 1


def likeness(image: Gray) -> Floats:
    """Return how much the texture of each row (h,) is like that of the next: the correlation, (h - 1,); 1 where one of them has none."""
    columns = np.asarray(image[:, ::COLUMNS_APART], dtype=np.float32)
    texture = columns - cv2.blur(columns, (MEAN_PX, 1))
    energy = np.einsum("rc,rc->r", texture, texture)
    both = np.sqrt(energy[:-1] * energy[1:])
    enough = np.minimum(energy[:-1], energy[1:]) > LEAST_DEVIATION**2 * columns.shape[1]
    alike: Floats = np.where(enough, np.einsum("rc,rc->r", texture[:-1], texture[1:]) / np.maximum(both, 1e-6), 1.0).astype(np.float32)
    return alike


def _breaks(alike: Floats) -> NDArray[np.bool_]:
    """Return at which rows (h - 1,) the image breaks off, by the likeness of the rows."""
    found = np.zeros(len(alike), dtype=np.bool_)
    beside = np.min([alike[k : len(alike) - 4 + k] for k in (0, 1, 3, 4)], axis=0)
    found[2:-2] = (alike[2:-2] < SEAM) & (alike[2:-2] < beside - BESIDE)
    return found


def _profile(image: Gray) -> Floats:
    profile: Floats = np.asarray(cv2.reduce(image, 1, cv2.REDUCE_AVG, dtype=cv2.CV_32F)).ravel()
    return profile


def _moved_px(before: Floats | None, now: Floats, row: int) -> float:
    """Return by how many whole pixels the rows above a seam moved up or down; 0 where that is not sure."""
    low, high = row - BAND - MOST_MOVED_PX, row - 1 - MOST_MOVED_PX
    if before is None or before.shape != now.shape or low < MOST_MOVED_PX:
        return 0.0
    band = now[low:high] - now[low:high].mean()
    differences = {}
    for shift in range(-MOST_MOVED_PX, MOST_MOVED_PX + 1):
        other = before[low + shift : high + shift]
        differences[shift] = float(np.sum((band - (other - other.mean())) ** 2))
    moved = min(differences, key=lambda shift: differences[shift])
    return float(abs(moved)) if differences[moved] < SURELY * differences[0] else 0.0
