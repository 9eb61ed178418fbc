"""The corridor that the vehicle is about to fly through, and what stands nearest in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOVING_M_S = 0.2
AT_TARGET_M = 0.3


@dataclass(frozen=True)
class Corridor:
    """A box from the vehicle's centre along its motion; metres.

    Half width: the vehicle's radius with propellers (0.85 m) and a margin of 0.4 m. What is lower than ``floor_m`` above the map's ground
    is ground. Obstacles are counted only beyond ``near_m`` from the centre: nearer is the vehicle itself.
    """

    half_width_m: float = 1.25
    half_height_m: float = 0.6
    length_m: float = 8.0
    near_m: float = 0.3
    floor_m: float = 0.2

    def surrounds(self, seen: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return which points (N, 3: metres ahead, left, above) are in the corridor, or in the ground that it cuts."""
        inside: NDArray[np.bool_] = (
            (np.abs(seen[:, 1]) <= self.half_width_m)
            & (np.abs(seen[:, 2]) <= self.half_height_m)
            & (seen[:, 0] >= self.near_m)
            & (seen[:, 0] <= self.length_m)
        )
        return inside

    def contains(self, seen: NDArray[np.float64], height_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points (N, 3: metres ahead, left, above; and their height over the ground, (N,)) are in the corridor."""
        return self.surrounds(seen) & (height_m >= self.floor_m)


@dataclass(frozen=True)
class VehicleMotion:
    """What the guidance says about the motion: velocity (m/s, ENU) and the target (metres, ENU) when it follows a position reference."""

    velocity_enu_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    target_enu_m: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Support:
    """How much must be seen in one place before it is believed to be an obstacle.

    The corridor is cut into cells of ``cell_m``; along it they grow as ``range_error_per_m * distance**2`` where that is longer (stereo).
    Two by two by two neighbouring cells must together hold ``min_points`` points and ``min_area_m2`` of seen surface.
    """

    min_points: int = 3
    min_area_m2: float = 0.0
    cell_m: float = 0.25
    range_error_per_m: float = 0.0
    percentile: float = 10.0


@dataclass(frozen=True)
class Nearest:
    """The nearest believed obstacle: metres from the vehicle's centre along the corridor, where, and how large what is seen of it is.

    The size is along the corridor, across and up, of the connected points in the corridor.
    """

    distance_m: float
    point_enu_m: tuple[float, float, float]
    size_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Ahead:
    """What is ahead: the nearest obstacle, or None; then ``unknown`` says why the corridor can't be called free, or nothing."""

    nearest: Nearest | None
    unknown: str = ""


def direction_of_motion(position_enu_m: NDArray[np.float64], nose: NDArray[np.float64], motion: VehicleMotion) -> NDArray[np.float64]:
    """Return the horizontal unit vector (3,) of the motion: of the velocity if moving, else towards the target, else of the nose."""
    target = position_enu_m if motion.target_enu_m is None else np.array(motion.target_enu_m)
    for way, least in ((motion.velocity_enu_m_s, MOVING_M_S), (target - position_enu_m, AT_TARGET_M), (nose, 0.0)):
        length = float(np.hypot(way[0], way[1]))
        if length > least:
            return np.array([way[0] / length, way[1] / length, 0.0])
    return np.array([1.0, 0.0, 0.0])


def corridor_coordinates(
    points_enu_m: NDArray[np.float64], origin_enu_m: NDArray[np.float64], direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (N, 3): metres ahead, to the left and above the origin, seen along the horizontal direction."""
    axes = np.array([direction, [-direction[1], direction[0], 0.0], [0.0, 0.0, 1.0]])
    seen: NDArray[np.float64] = (points_enu_m - origin_enu_m) @ axes.T
    return seen


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
    block = grid.nearest_block(areas, support)
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

    def nearest_block(self, areas_m2: NDArray[np.float64], support: Support) -> NDArray[np.intp] | None:
        """Return the near corner of the nearest block of 2x2x2 cells with enough support."""
        counts = _blocks(self.counts)
        weights = np.bincount(self.flat, weights=areas_m2, minlength=self.counts.size).astype(np.float64)
        surface = _blocks(weights.reshape(self.counts.shape))
        believed = np.argwhere((counts >= support.min_points) & (surface >= support.min_area_m2))
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
