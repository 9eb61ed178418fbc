"""The nearest obstacle among points in a corridor. Apart from it: scipy takes a fifth of a second to import, and not all nodes ask."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from perception_core.corridor import Corridor, Nearest, Support, corridor_coordinates

if TYPE_CHECKING:
    from numpy.typing import NDArray


def nearest_obstacle(
    points_enu_m: NDArray[np.float64],
    origin_enu_m: NDArray[np.float64],
    direction: NDArray[np.float64],
    corridor: Corridor,
    support: Support,
    areas_m2: NDArray[np.float64] | None = None,
    heights_m: NDArray[np.float64] | None = None,
) -> Nearest | None:
    """Return the nearest place in the corridor with enough support, or None; NaN points are left out.

    ``areas_m2`` (N,) is the surface that each point stands for (stereo: the footprint of its pixel); without it only points are counted.
    ``heights_m`` (N,) is above the ground; without it the ground is at the map's 0.
    """
    seen = corridor_coordinates(points_enu_m, origin_enu_m, direction)
    index = np.flatnonzero(corridor.contains(seen, points_enu_m[:, 2] if heights_m is None else heights_m))
    if len(index) < support.min_points:
        return None
    areas = np.ones(len(index)) if areas_m2 is None else areas_m2[index]
    grid = _Grid.of(seen[index], corridor, support)
    block = grid.nearest_block(areas, support, _edges_ahead(corridor, support))
    if block is None:
        return None
    of_block = index[grid.in_block(block)]
    distance = float(np.percentile(seen[of_block, 0], support.percentile))
    closest = of_block[np.argmin(np.abs(seen[of_block, 0] - distance))]
    x, y, z = (float(value) for value in points_enu_m[closest])
    low, high = np.percentile(seen[index[grid.connected_to(block)]], (2.0, 98.0), axis=0)
    along, across, up = (float(size) for size in high - low)
    return Nearest(distance_m=distance, point_enu_m=(x, y, z), size_m=(along, across, up))


def _edges_ahead(corridor: Corridor, support: Support) -> NDArray[np.float64]:
    edges = [corridor.near_m]
    while edges[-1] < corridor.length_m:
        edges.append(edges[-1] + max(support.cell_m, support.range_error_per_m * edges[-1] ** 2))
    return np.array(edges)


@dataclass(frozen=True)
class _Grid:
    """The corridor's cells: which of them each point is in, (N, 3), and how many points are in each."""

    cells: NDArray[np.intp]
    flat: NDArray[np.intp]
    counts: NDArray[np.float64]

    @classmethod
    def of(cls, seen: NDArray[np.float64], corridor: Corridor, support: Support) -> _Grid:
        """Cut the corridor into cells."""
        edges = _edges_ahead(corridor, support)
        cells = np.empty((len(seen), 3), dtype=np.intp)
        cells[:, 0] = np.searchsorted(edges, seen[:, 0], side="right") - 1
        cells[:, 1] = (seen[:, 1] + corridor.half_width_m) / support.cell_m
        cells[:, 2] = (seen[:, 2] + corridor.half_height_m) / support.cell_m
        # One empty cell on the far sides: then every cell is the near corner of a block.
        shape = (len(edges) + 1, int(2 * corridor.half_width_m / support.cell_m) + 2, int(2 * corridor.half_height_m / support.cell_m) + 2)
        flat = np.ravel_multi_index((cells[:, 0], cells[:, 1], cells[:, 2]), shape)
        counts = np.bincount(flat, minlength=int(np.prod(shape))).astype(np.float64).reshape(shape)
        return cls(cells=cells, flat=flat, counts=counts)

    def nearest_block(self, areas_m2: NDArray[np.float64], support: Support, edges_m: NDArray[np.float64]) -> NDArray[np.intp] | None:
        """Return the near corner of the nearest block of 2x2x2 cells with enough support; ``edges_m`` (C,) is where they begin, ahead."""
        counts = _blocks(self.counts)
        weights = np.bincount(self.flat, weights=areas_m2, minlength=self.counts.size).astype(np.float64)
        surface = _blocks(weights.reshape(self.counts.shape))
        least = np.maximum(support.min_points, support.points_at_1_m / np.maximum(edges_m + support.cell_m, 1.0) ** 2)
        believed = np.argwhere((counts >= least[:, None, None]) & (surface >= support.min_area_m2))
        if not len(believed):
            return None
        candidates = believed[believed[:, 0] == believed[0, 0]]
        nearest: NDArray[np.intp] = candidates[np.argmax(counts[tuple(candidates.T)])]
        return nearest

    def in_block(self, block: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return which points are in the block."""
        inside: NDArray[np.bool_] = np.all((self.cells >= block) & (self.cells <= block + 1), axis=1)
        return inside

    def connected_to(self, block: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return which points are in occupied cells that touch those of the block, one after the other: one thing, as far as is seen."""
        labels, _ = ndimage.label(self.counts > 0, structure=np.ones((3, 3, 3)))
        of_points = labels.reshape(-1)[self.flat]
        connected: NDArray[np.bool_] = np.isin(of_points, np.unique(of_points[self.in_block(block)]))
        return connected


def _blocks(cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each cell the sum over the block of which it is the near corner."""
    result = cells
    for axis in range(3):
        low = tuple(slice(0, -1) if a == axis else slice(None) for a in range(3))
        high = tuple(slice(1, None) if a == axis else slice(None) for a in range(3))
        result = result[low] + result[high]
    return result
