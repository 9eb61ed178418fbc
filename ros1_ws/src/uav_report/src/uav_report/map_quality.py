"""How good a map is against the true surfaces: its error, and how much it holds of what was in reach.

What was in reach depends on the planned route alone, never on what was flown. A surface patch is in reach if, from some point
of the route, it lies beside the leg (within 30 degrees of the plane across it), within 10 m horizontally, hidden by nothing
and not seen edge-on. Beside, because a survey sweeps across its legs: what lies before the first point and behind the last
belongs to no leg. 10 m, because that is what one leg is for: the LiDAR reaches 25 m, but there it meets the ground at a grazing
angle, with gaps wider than the patches.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from alula.common.open3d_core import o3d
from alula.report.files import Problems, ReportError, finite, mapping, sequence
from uav_report.world import TrueSurfaces

PATCH_M = 0.25  # one sample for each square of this side
SEED = 1
REACH_M = 10.0  # horizontally
BESIDE_DEG = 30.0  # from the plane across the leg
LIDAR_RANGE_M = 25.0  # in space
VIEWPOINT_STEP_M = 1.0
GRAZING_DEG = 5.0  # flatter than this a patch is seen edge-on
COVERED_WITHIN_M = 0.25
SIGHT_TOLERANCE_M = 0.02
ERROR_SAMPLE = 200_000  # points of the map whose distance is computed, evenly picked

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MapQuality:
    """``rmse_m`` of the map's points to the true surfaces without alignment; ``coverage`` 0..1 of the patches in reach.

    ``missed_enu_m`` (M, 3): the patches in reach that the map does not hold. None where something to compare with is missing.
    """

    points: int | None = None
    rmse_m: float | None = None
    coverage: float | None = None
    in_reach: int | None = None
    missed_enu_m: Floats | None = None


def load_map(path: Path) -> Floats:
    """Return the finite points of a cloud, (N, 3), frame map; raise ReportError when it is missing or unreadable."""
    if not path.exists():
        raise ReportError(f"{path.name} is missing")
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        points = np.asarray(o3d.io.read_point_cloud(str(path)).points, dtype=np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise ReportError(f"{path.name} holds no points")
    return points


def load_route(mission: Mapping[str, object]) -> Floats:
    """Return the planned waypoints, (N, 3), frame map; raise ReportError when they are missing or unreadable.

    It is among the inputs in the mission's account.
    """
    listed = mapping(mission.get("inputs")).get("route")
    waypoints = [[finite(number) for number in sequence(waypoint)] for waypoint in sequence(listed)]
    if not waypoints or any(len(waypoint) != 3 or None in waypoint for waypoint in waypoints):
        raise ReportError("the mission's route is no list of [x, y, z]")
    return np.asarray(waypoints, dtype=np.float64)


def judge_map(points: Floats | None, route: Floats | None, world: TrueSurfaces | None, problems: Problems) -> MapQuality:
    """Judge the map as far as map, route and world are there."""
    if points is None:
        return MapQuality()
    rmse_m: float | None = None
    if world is not None:
        rmse_m = error_m(points, world)
    if world is None or route is None:
        return MapQuality(points=len(points), rmse_m=rmse_m)
    patches = patches_in_reach(world, route)
    if not len(patches):
        problems.note("no surface is in reach of the planned route: the map's coverage means nothing")
        return MapQuality(points=len(points), rmse_m=rmse_m, in_reach=0)
    covered = covered_by(points, patches)
    return MapQuality(len(points), rmse_m, float(covered.mean()), len(patches), patches[~covered])


def error_m(points: Floats, world: TrueSurfaces) -> float:
    """Return the root of the mean squared distance of the map's points to the true surfaces."""
    step = max(1, -(-len(points) // ERROR_SAMPLE))
    return float(np.sqrt(np.mean(world.distance_m(points[::step]) ** 2)))


def covered_by(points: Floats, patches: Floats) -> NDArray[np.bool_]:
    """Return for each patch (N, 3) whether a point of the map lies within a quarter of a metre."""
    distance, _ = cKDTree(points).query(patches, distance_upper_bound=COVERED_WITHIN_M)
    return np.asarray(np.isfinite(distance))


def viewpoints(route: Floats) -> tuple[Floats, Floats]:
    """Return points at most a metre apart along each leg, both ends included, and the leg's unit direction, (N, 3) each.

    A route of one point has no direction: zeros, so that everything around lies beside it.
    """
    places, directions = [route[:1]], [np.zeros((1, 3))]
    for start, end in pairwise(route):
        length = float(np.linalg.norm(end - start))
        steps = max(1, int(np.ceil(length / VIEWPOINT_STEP_M)))
        places.append(start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (end - start))
        directions.append(np.broadcast_to((end - start) / max(length, 1e-9), (steps + 1, 3)))
    only_legs = slice(0 if len(route) == 1 else 1, None)
    return np.concatenate(places[only_legs]), np.concatenate(directions[only_legs])


def patches_in_reach(world: TrueSurfaces, route: Floats) -> Floats:
    """Return the centres of the surface patches that a perfect survey of the route sees, (N, 3)."""
    patches, normals = world.sample(PATCH_M, SEED)
    seen = np.zeros(len(patches), dtype=bool)
    columns = cKDTree(patches[:, :2])
    for viewpoint, along in zip(*viewpoints(route), strict=True):
        near = np.asarray(columns.query_ball_point(viewpoint[:2], REACH_M), dtype=np.int64)
        near = near[~seen[near]]
        seen[near[_visible(world, viewpoint, along, patches[near], normals[near])]] = True
    return np.asarray(patches[seen], dtype=np.float64)


def _visible(world: TrueSurfaces, viewpoint: Floats, along: Floats, patches: Floats, normals: Floats) -> NDArray[np.bool_]:
    """Tell which patches are in the LiDAR's range, beside the leg, not edge-on, and hidden by nothing."""
    sight = patches - viewpoint
    distance = np.linalg.norm(sight, axis=1)
    direction = sight / np.maximum(distance, 1e-9)[:, None]
    beside = np.abs(direction @ along) < np.sin(np.radians(BESIDE_DEG))
    facing = np.abs((direction * normals).sum(axis=1)) > np.sin(np.radians(GRAZING_DEG))
    open_to = (distance < LIDAR_RANGE_M) & beside & facing
    visible = np.zeros(len(patches), dtype=bool)
    visible[open_to] = world.first_hit_m(viewpoint, direction[open_to]) > distance[open_to] - SIGHT_TOLERANCE_M
    return visible
