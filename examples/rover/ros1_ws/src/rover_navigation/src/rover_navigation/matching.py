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

from rover_navigation.geometry import Points, Pose, along, compose, inverse, transformed, wrapped
from rover_navigation.grid_map import GridMap

MATCHES_M = 0.1  # a beam matches that ends so near to something that the map has
BEAMS = 90  # of a scan that are used
SOFT_M = 0.05  # residuals above count less and less: people and doors are not on the map
GATE_M = 0.3  # what is farther from the map at the guess is not on it
PRIOR = np.array([2.0, 2.0, 2.0])  # residual (metres) of leaving the guess by a metre or radian: along a bare corridor odometry decides
FOUND = 0.75  # a search that finds less has found nothing
CERTAIN = 0.06  # by so much the best place has to fit better than the next
SEARCH_BEAMS = 45  # of each scan
LEVELS = ((0.4, math.radians(15.0), 9), (0.2, math.radians(7.5), 3), (0.1, math.radians(3.75), 1))
"""Of the search: from one of its poses to the next (metres, radians), and every how many of the beams are used."""
YAWS, BRANCHES = 2, 2000  # of each position on the first level, and of all poses of a level, so many are searched more finely
PLACES = 20  # that are told, at most
APART_M, APART_RAD = 0.5, 0.3  # poses nearer to each other are the same place
RIM_M, STEP_M, SHORT_M = 0.25, 0.05, 0.2  # a beam is looked along from the rover's rim, in steps, to so far before its end


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


def locate(grid: GridMap, scans: Sequence[tuple[Pose, Points]]) -> tuple[Pose | None, str]:
    """Return the pose at the last scan and how well it fits; None, and why, where nobody knows. Arguments: as for ``search``."""
    places = search(grid, scans) if scans else []
    if not places or places[0].quality < FOUND:
        return None, f"no place fits by {100.0 * FOUND:.0f} %"
    best, others = places[0], [place.quality for place in places[1:]]
    if others and best.quality - others[0] < CERTAIN:
        return None, f"two places fit, by {100.0 * best.quality:.0f} and {100.0 * others[0]:.0f} %"
    return best.pose, f"the place fits by {100.0 * best.quality:.0f} %"


def search(grid: GridMap, scans: Sequence[tuple[Pose, Points]]) -> list[Match]:
    """Return the places on the whole map that fit, the best one first; where the second fits as well, nobody knows which one it is.

    Coarse to fine: at each level the poses that fit best are searched on. What counts at last is which part of the beams matches, less
    the part that would have gone through something: a shut door that is not on the map shortens beams, but none gets through a wall.

    Args:
        grid: the map.
        scans: of a rover that turns, each with its pose in odom; their points in base_link. The poses are those of the last scan.
    """
    last = scans[-1][0]
    placed = [(compose(inverse(last), odom), thinned(points, SEARCH_BEAMS)) for odom, points in scans]
    here = np.concatenate([transformed(T_last_scan, points) for T_last_scan, points in placed])
    places: list[Pose] = []
    for pose in _searched(grid, here).tolist():
        if all(apart((pose[0], pose[1], pose[2]), other) for other in places):
            places.append((pose[0], pose[1], pose[2]))
        if len(places) == PLACES:
            break
    found: list[Match] = []
    for near in (match(grid, place, here) for place in places):
        through = [beams_through(grid, compose(near.pose, T_last_scan), points) for T_last_scan, points in placed]
        found.append(Match(near.pose, near.quality - float(np.concatenate(through).mean())))
    found.sort(key=lambda one: -one.quality)
    return [one for i, one in enumerate(found) if all(apart(one.pose, better.pose) for better in found[:i])]


def apart(a: Pose, b: Pose) -> bool:
    """Return whether two poses are different places."""
    return math.dist(a[:2], b[:2]) > APART_M or abs(wrapped(a[2] - b[2])) > APART_RAD


def beams_through(grid: GridMap, pose: Pose, points: Points) -> NDArray[np.bool_]:
    """Return (N,) which beams would have gone through something that is on the map to their ends, the points in base_link."""
    looks, before = along(points, RIM_M, STEP_M, SHORT_M)
    there = grid.occupied[grid.cells(transformed(pose, looks.reshape(-1, 2)))].reshape(before.shape)
    return np.asarray((there & before).any(axis=1))


def _searched(grid: GridMap, here: Points) -> NDArray[np.float64]:
    """Return the poses (N, 3) of the finest level at which the points fit best, the best one first."""
    size_m, size_rad, every = LEVELS[0]
    step = round(size_m / grid.resolution_m)
    positions = grid.middles(np.column_stack(np.nonzero(grid.distance_m[::step, ::step] > 0.0)) * step)
    yaws = np.arange(-math.pi, math.pi, size_rad)
    poses = np.concatenate([np.column_stack((positions, np.full(len(positions), yaw))) for yaw in yaws])
    misses = _misses_m(grid, poses, here[::every], size_m).reshape(len(yaws), -1)
    best = np.argsort(misses, axis=0)[:YAWS]  # so that no position is forgotten because of others where many yaws fit
    poses = poses.reshape(len(yaws), -1, 3)[best, np.arange(len(positions))].reshape(-1, 3)
    poses = poses[np.argsort(np.take_along_axis(misses, best, axis=0).ravel())[:BRANCHES]]
    halves = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T
    for size_m, size_rad, every in LEVELS[1:]:
        poses = (poses[:, None, :] + halves * (size_m, size_m, size_rad)).reshape(-1, 3)
        poses = poses[np.argsort(_misses_m(grid, poses, here[::every], size_m))[:BRANCHES]]
    return np.asarray(poses, dtype=np.float64)


def _misses_m(grid: GridMap, poses: NDArray[np.float64], points: Points, size_m: float) -> NDArray[np.float64]:
    """Return (N,) how far the points are from the map at each pose (N, 3), the mean; what misses by four steps misses by more, too."""
    misses = []
    for some in np.array_split(poses, len(poses) // 1000 + 1):  # in parts, for the memory's sake
        cos, sin = np.cos(some[:, 2:]), np.sin(some[:, 2:])
        x = some[:, :1] + cos * points[:, 0] - sin * points[:, 1]
        y = some[:, 1:2] + sin * points[:, 0] + cos * points[:, 1]
        cells = grid.cells(np.column_stack((x.ravel(), y.ravel())))
        misses.append(np.minimum(grid.distance_m[cells], 4.0 * size_m).reshape(x.shape).mean(axis=1))
    return np.concatenate(misses)
