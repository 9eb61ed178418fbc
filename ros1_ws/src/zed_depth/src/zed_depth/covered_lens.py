"""A lens that is covered in part: what one image shows, and the other one has nothing of, or in another light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from perception_core import FaultKind, Finding, broken

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Gray = NDArray[np.uint8]
    Floats = NDArray[np.float64]

TILES = (8, 20)  # rows and columns in which both images are compared for a lens that is partly covered,
TILE_CELLS = 5  # each cut into 5 x 5 averages, which have a third of the pixels' noise or less
CONTENT, NO_CONTENT = 6.0, 2.0  # grey levels, deviation within a tile
REACH = 0.2  # of the width: the farthest that content is looked for
COVERED = 0.08  # of the tiles, without content where the other image has some
OTHER_LIGHT, OTHER_LIGHT_SHARE = 20.0, 0.2  # grey levels and share of the light by which a tile may differ from the other image's
WHITE = 245.0  # grey levels: what is as bright may be brighter
COVERED_LIGHT = 0.04  # of the tiles, as bright as nothing there; good pairs have 0.006


def covered_finding(left: Gray, right: Gray, offset_px: float, gain: float) -> Finding | None:
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
            told = f"the {side} camera sees nothing where the other one does, {without_content:.0%} of its view"
            return broken(FaultKind.VIEW, told, "its lens is covered or dirty", "its exposure or focus is wrong there")
        other_light = max(other_light, float(np.mean(mine_is_darker | mine_is_brighter)))
    if other_light > COVERED_LIGHT:
        told = f"{other_light:.0%} of the view is much darker or brighter in one image"
        return broken(FaultKind.VIEW, told, "a lens is partly covered", "the cameras expose or convert the light differently")
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
