"""Localisation by matching scans with the map: the pose for which what the laser hits lies on what the map has.

Near a known pose by least squares on the map's distance field (Fitzgibbon, "Robust registration of 2D and 3D point sets", 2003);
without one by trying poses all over the map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.optimize import least_squares

from rover_navigation.geometry import Points, Pose, compose, inverse, transformed, wrapped
from rover_navigation.grid_map import GridMap

MATCHES_M = 0.1  # a beam matches that ends so near to something that the map has
BEAMS = 90  # of a scan that are used
SOFT_M = 0.05  # residuals above count less and less: people and doors are not on the map
GATE_M = 0.3  # what is farther from the map at the guess is not on it
PRIOR = np.array([2.0, 2.0, 2.0])  # residual (metres) of leaving the guess by a metre or radian: along a bare corridor odometry decides
SEARCH_M, SEARCH_RAD, SEARCH_BEAMS = 0.4, math.radians(15.0), 45
REFINED = 12  # of the search's best poses
CLEARANCE_M = 0.25  # the rover's radius: it is nowhere nearer to a wall


@dataclass(frozen=True)
class Match:
    """A pose, and which part of the beams matches there (0 to 1)."""

    pose: Pose
    quality: float


def thinned(points: Points, count: int) -> Points:
    """Return about so many of the points, evenly."""
    return points[:: max(1, len(points) // count)]


def quality_at(grid: GridMap, pose: Pose, points: Points) -> float:
    """Return which part of the points (frame base_link) lies on the map."""
    rows, columns = grid.cells(transformed(pose, points))
    return float(np.mean(grid.distance_m[rows, columns] < MATCHES_M)) if len(points) else 0.0


def match(grid: GridMap, guess: Pose, points: Points) -> Match:
    """Return the pose near the guess at which the points, in base_link, fit best."""
    used = thinned(points[grid.distance_m[grid.cells(transformed(guess, points))] < GATE_M], BEAMS)
    if not len(used):
        return Match(guess, 0.0)

    def residuals(change: NDArray[np.float64]) -> NDArray[np.float64]:
        pose = (guess[0] + change[0], guess[1] + change[1], guess[2] + change[2])
        cells = (transformed(pose, used) - np.array(grid.origin_m)) / grid.resolution_m - 0.5
        misses = map_coordinates(grid.distance_m, cells[:, ::-1].T, order=1, mode="nearest")
        return np.concatenate((misses, PRIOR * change))

    change = least_squares(residuals, np.zeros(3), loss="cauchy", f_scale=SOFT_M, max_nfev=12).x
    pose = (guess[0] + float(change[0]), guess[1] + float(change[1]), wrapped(guess[2] + float(change[2])))
    return Match(pose, quality_at(grid, pose, points))


def search(grid: GridMap, scans: Sequence[tuple[Pose, Points]]) -> Match:
    """Return the best pose on the whole map.

    Args:
        grid: the map.
        scans: of a rover that turns, each with its pose in odom; their points in base_link. The pose is that of the last scan.
    """
    last = scans[-1][0]
    here = np.concatenate([transformed(compose(inverse(last), odom), thinned(points, SEARCH_BEAMS)) for odom, points in scans])
    step = round(SEARCH_M / grid.resolution_m)
    rows, columns = np.nonzero(grid.distance_m[::step, ::step] > CLEARANCE_M)
    positions = grid.middles(np.column_stack((rows, columns)) * step)
    found = []
    for yaw in np.arange(-math.pi, math.pi, SEARCH_RAD):
        turned = transformed((0.0, 0.0, float(yaw)), here)
        cells = grid.cells((positions[:, None, :] + turned[None, :, :]).reshape(-1, 2))
        misses = np.minimum(grid.distance_m[cells], SEARCH_M).reshape(len(positions), -1).mean(axis=1)
        found += [(float(misses[i]), (*positions[i].tolist(), float(yaw))) for i in np.argsort(misses)[:3]]
    best = sorted(found)[:REFINED]
    return max((match(grid, pose, here) for _, pose in best), key=lambda candidate: candidate.quality)
