"""The way: shortest paths on the map and on what the laser has seen besides, by scikit-image's minimum-cost paths."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from skimage.graph import route_through_array

from rover_navigation.geometry import Points, Pose, along, transformed
from rover_navigation.grid_map import GridMap

RADIUS_M = 0.25
MARGIN_M = 0.06  # at least so far from everything
KEEP_M = 0.5  # ways nearer to something than this cost more
COARSE = 2  # planning's cells are so many of the map's
SEEN_M = 0.15  # what the laser hits so near to something of the map is no news
LEAVE_M = 0.4  # around the rover itself ways are allowed that are too narrow: it stands there
RECENT_S = 2.0  # what was seen within it is there


class NoWayError(Exception):
    """There is no way; the message says why."""


class Surroundings:
    """The map, and when something that is not on it was last seen where: it stays until a beam goes through where it was.

    Who walks leaves marks in their own shadow, where no beam goes through. So what was not seen for longest is forgotten where there
    is no way else.
    """

    def __init__(self, grid: GridMap) -> None:
        self.grid = grid
        self.seen_s = np.full(grid.occupied.shape, -np.inf)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Return the cells in which something was seen."""
        return np.asarray(np.isfinite(self.seen_s))

    def look(self, pose: Pose, points: Points, free: Points, now_s: float) -> None:
        """Take in what the laser hit, and how far the beams came that hit nothing; both in base_link, from a pose in map."""
        self._clear(pose, np.vstack((points, free)))
        cells = self.grid.cells(transformed(pose, points))
        news = self.grid.distance_m[cells] > SEEN_M
        self.seen_s[cells[0][news], cells[1][news]] = now_s

    def forget(self, until_s: float = np.inf) -> None:
        """Forget what was not seen after a time; all: after the pose was wrong it is in wrong places."""
        self.seen_s[self.seen_s <= until_s] = -np.inf

    def distance_m(self, *, seen: bool) -> NDArray[np.float64]:
        """Return how far each cell is from the next occupied one; ``seen``: also from what was seen."""
        return (
            np.asarray(distance_transform_edt(~(self.grid.occupied | self.seen))) * self.grid.resolution_m if seen else self.grid.distance_m
        )

    def _clear(self, pose: Pose, ends: Points) -> None:
        rays, before = along(ends, RADIUS_M, self.grid.resolution_m, 2.0 * self.grid.resolution_m)
        self.seen_s[self.grid.cells(transformed(pose, rays[before]))] = -np.inf


def plan_anew(around: Surroundings, start: Pose, goal: Pose, now_s: float) -> Points:
    """Plan; where no way is left, forget what was not seen for longest, as little of it as there is a way again.

    Raises:
        NoWayError: as ``plan``, also without all that was not seen within the last RECENT_S; then nothing is forgotten.
    """
    try:
        return plan(around, start, goal)
    except NoWayError:
        before, times = around.seen_s.copy(), np.unique(around.seen_s[around.seen])
        old = times[times < now_s - RECENT_S]
        if not len(old):
            raise
    few, most = 0, len(old) - 1  # the way is searched for by halves: with more forgotten there is one all the more
    try:
        while few < most:
            middle = (few + most) // 2
            few, most = (few, middle) if _a_way(around, before, old[middle], start, goal) else (middle + 1, most)
        _without(around, before, old[most])
        return plan(around, start, goal)
    except NoWayError:
        around.seen_s[:] = before
        raise


def _a_way(around: Surroundings, before: NDArray[np.float64], until_s: float, start: Pose, goal: Pose) -> bool:
    _without(around, before, until_s)
    try:
        plan(around, start, goal)
    except NoWayError:
        return False
    return True


def _without(around: Surroundings, before: NDArray[np.float64], until_s: float) -> None:
    around.seen_s[:] = before
    around.forget(until_s)


def plan(around: Surroundings, start: Pose, goal: Pose, *, seen: bool = True) -> Points:
    """Return the way as points in map, from the start to the goal.

    Raises:
        NoWayError: the goal is too near to something, or everything between is too narrow.
    """
    distance = around.distance_m(seen=seen)[::COARSE, ::COARSE]
    size = around.grid.resolution_m * COARSE
    ends = np.array([start[:2], goal[:2]])
    rows, columns = (np.minimum(cells // COARSE, most - 1) for cells, most in zip(around.grid.cells(ends), distance.shape, strict=True))
    narrow = distance < RADIUS_M + MARGIN_M
    if narrow[rows[1], columns[1]]:
        raise NoWayError(f"({goal[0]:.2f}, {goal[1]:.2f}) is taken: something is {distance[rows[1], columns[1]]:.2f} m from it")
    cost = 1.0 + 4.0 * np.clip(1.0 - (distance - RADIUS_M) / KEEP_M, 0.0, 1.0)
    row, column = np.indices(distance.shape)
    here = np.hypot(row - rows[0], column - columns[0]) * size < LEAVE_M
    cost[narrow] = np.inf
    cost[narrow & here & (distance > 0.0)] = 50.0
    cost[rows[0], columns[0]] = 1.0
    try:
        cells, total = route_through_array(cost, (rows[0], columns[0]), (rows[1], columns[1]), fully_connected=True, geometric=True)
    except ValueError as error:  # scikit-image's word for an end that can't be reached
        raise NoWayError(f"no way to ({goal[0]:.2f}, {goal[1]:.2f}): everything between is too narrow") from error
    if not np.isfinite(total):
        raise NoWayError(f"no way to ({goal[0]:.2f}, {goal[1]:.2f}): everything between is too narrow")
    way = around.grid.middles(np.array(cells, dtype=np.intp) * COARSE)
    return np.vstack((way[1:-1], goal[:2]))
