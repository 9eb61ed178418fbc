"""From a sweep to the nearest obstacle ahead of the motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidar_obstacles.ground import ASIDE_M, BEHIND_M, GroundModel, GroundSettings
from perception_core import (
    NS,
    Ahead,
    Corridor,
    Nearest,
    PoseBuffer,
    Support,
    Sweep,
    VehicleMotion,
    deskew,
    direction_of_motion,
)
from perception_core.nearest import nearest_obstacle

Floats = NDArray[np.float64]
NOTHING_M = 0.05  # from the sensor; a point that is nearer is no return
BLUR_M = 1.0  # by as much at most a point is moved when its sweep is straightened, within the region that is looked at
VIEW_DEG = 10.0  # the sensor sees the way ahead if it has returns from all parts within this angle of it, seen from above ...
VIEW_PARTS = 4  # a gap of ten degrees leaves one of them empty, wherever it begins
LEVEL_DEG = 15.0  # above and below the way: of a sensor that looks further up and down, what it sees there counts for no place ahead
SOLID_SHARE = 0.02  # of the level returns in the view of the way ahead; half a metre of a cable of 1 cm that is 1 m away has 0.029
FILLED_SHARE = 0.25  # ... where the nearest returns stand alone: half a metre that is filled has 1.4
SCATTERED_M = 8.0  # from the sensor; farther away a thing has few returns beside each other
PLACE_M, BESIDE_RAD = 0.5, np.radians(1.0)  # around the nearest returns, and the directions beside these
SOLID_S = 1.0  # for so long what was side by side counts as solid
SEEDS, NEIGHBOURS, ALIKE_M = 24, 6, 0.25  # returns that are looked at, those next to them in direction, and how near their ranges are
MOST_ALONE, IN_LINE_M = 0.5, 0.04  # share of returns that have none beside them; deviation from a line, as a cable's
AIR = "rain, dust or snow, or the light of another LiDAR"
STEEP_DEG = 60.0  # ... that are not below or above the vehicle
ASIDE_DEG = 20.0  # from the way ahead to the middle of a sector that lost its returns; an obstacle at 4 m may be as far aside


@dataclass(frozen=True)
class Body:
    """The vehicle: a cylinder around base_link's z axis. Returns from inside it are its own."""

    radius_m: float = 1.0
    half_height_m: float = 0.6


@dataclass(frozen=True)
class LidarAheadSettings:
    """Where to look, how much evidence to require, and which returns are the vehicle's own or ground.

    With fewer than ``min_ahead`` returns from one of the parts of the view of the way ahead, near or far, it is unknown what is there.
    """

    corridor: Corridor
    support: Support
    body: Body
    ground: GroundSettings
    min_ahead: int = 4


class LidarAhead:
    """Look ahead by sweeps in their order; not thread-safe."""

    def __init__(self, settings: LidarAheadSettings) -> None:
        self._settings = settings
        self._ground = GroundModel(settings.ground)
        self._solid: tuple[int, Floats] | None = None  # when and where the nearest returns were side by side

    def look(
        self,
        sweep: Sweep,
        *,
        T_base_lidar: Floats,  # noqa: N803 -- T_target_source
        poses: PoseBuffer,
        motion: VehicleMotion,
        gone: NDArray[np.bool_] | None = None,
    ) -> Ahead:
        """Return what is ahead of where the vehicle was at the end of the sweep; raise PoseUnavailableError.

        ``gone`` are the sectors that have just lost their returns, as of ``CloudJudge``.
        """
        settings = self._settings
        sweep = _timed(sweep)
        pose = poses.at([sweep.end_ns]).matrix()
        position = pose[:3, 3]
        direction = direction_of_motion(position, pose[:3, 0], motion)
        around = self._around(sweep, pose, T_base_lidar, direction)
        support = _support(settings.support, around.level)
        near = deskew(around.near, poses, T_base_lidar, position)
        nearest = self._nearest(near, position, direction, support)
        if nearest is not None and not self._is_solid(nearest, around, direction, position, sweep.end_ns):
            told = f"the returns {nearest.distance_m:.1f} m ahead stand alone in the air: {AIR}"
            return Ahead(self._nearest(near, position, direction, replace(support, points_at_1_m=FILLED_SHARE * around.level)), told)
        if around.ahead.min() < settings.min_ahead:
            return Ahead(nearest, _not_seen(around.ahead))
        if around.down < settings.min_ahead:
            return Ahead(nearest, f"the LiDAR does not look down to the way ahead: {around.down} returns from so low")
        if gone is not None and _towards(direction @ pose[:3, :3] @ T_base_lidar[:3, :3], gone):
            return Ahead(nearest, "the LiDAR has just lost its returns from where the vehicle goes")
        return Ahead(nearest)

    def _is_solid(self, nearest: Nearest, around: _Around, direction: Floats, position: Floats, stamp_ns: int) -> bool:
        """Return whether the nearest returns are side by side; what was solid a moment ago is not looked at again."""
        place = np.array(nearest.point_enu_m)
        if self._solid is not None:
            then_ns, there = self._solid
            if 0 <= stamp_ns - then_ns <= SOLID_S * NS and np.linalg.norm(place - there) < PLACE_M:
                return True
        if around.scattered(_along(direction) @ (place - position)):
            return False
        self._solid = (stamp_ns, place)
        return True

    def _nearest(self, points: NDArray[np.float32], position: Floats, direction: Floats, support: Support) -> Nearest | None:
        """Return the nearest obstacle among points in the map's axes, (N, 3) metres from the vehicle."""
        corridor = self._settings.corridor
        seen = points @ _along(direction).astype(np.float32).T
        within = np.flatnonzero(corridor.surrounds(seen))
        heights_m = self._ground.heights(seen, within, position, direction)
        in_map = points.take(within, axis=0) + position
        return nearest_obstacle(in_map, position, direction, corridor, support, heights_m=heights_m)

    def _around(self, sweep: Sweep, pose: Floats, T_base_lidar: Floats, direction: Floats) -> _Around:  # noqa: N803 -- T_target_source
        """Select the returns around the way ahead, by one pose for all; the vehicle's own are left out."""
        axes = _along(direction) @ pose[:3, :3]
        by_axis = np.ascontiguousarray(sweep.points.T)
        seen = _axes(by_axis, axes @ T_base_lidar[:3, :3], axes @ T_base_lidar[:3, 3])
        ahead, left, up = seen
        length_m = self._settings.corridor.length_m
        near = (ahead >= -BEHIND_M - BLUR_M) & (ahead <= length_m + BLUR_M) & (np.abs(left) <= ASIDE_M + BLUR_M)
        towards = (ahead >= 0.0) & (np.abs(left) <= np.tan(np.radians(VIEW_DEG)) * ahead)
        towards &= (up * up) <= np.tan(np.radians(STEEP_DEG)) ** 2 * (ahead * ahead + left * left)
        # The lowest that must be seen: the corridor's lower edge at its far end, from where the sensor is.
        sensor = axes @ T_base_lidar[:3, 3]
        falls = (self._settings.corridor.half_height_m + sensor[2]) / length_m
        of_ahead, of_left, of_up = seen.take(self._others(np.flatnonzero(towards), by_axis, T_base_lidar), axis=1)
        down = of_up - sensor[2] <= -falls * np.hypot(of_ahead - sensor[0], of_left - sensor[1])
        return _Around(
            near=sweep.select(self._others(np.flatnonzero(near), by_axis, T_base_lidar)),
            ahead=_parts_of_view(of_ahead, of_left),
            down=int(np.count_nonzero(down)),
            level=int(np.count_nonzero(np.abs(of_up) <= np.tan(np.radians(LEVEL_DEG)) * np.hypot(of_ahead, of_left))),
            seen=seen,
            sensor=sensor,
        )

    def _others(self, chosen: NDArray[np.intp], by_axis: NDArray[np.float32], T_base_lidar: Floats) -> NDArray[np.intp]:  # noqa: N803
        """Return which of the chosen points (3, N) are returns, and not the vehicle's own."""
        body, points = self._settings.body, by_axis.take(chosen, axis=1)
        x, y, z = _axes(points, T_base_lidar[:3, :3], T_base_lidar[:3, 3])
        own = (x * x + y * y <= body.radius_m**2) & (np.abs(z) <= body.half_height_m)
        squared = np.einsum("ij,ij->j", points, points)
        others: NDArray[np.intp] = chosen[~own & (squared >= NOTHING_M**2) & np.isfinite(squared)]
        return others


def _support(least: Support, level: int) -> Support:
    """Return how many returns an obstacle has at least, of a sensor with so many level ones in the view of the way ahead.

    To a dense sensor three returns in a place nearby are some drops of rain: a post of 5 cm at 4 m has sixty.
    """
    return replace(least, points_at_1_m=SOLID_SHARE * level)


def _timed(sweep: Sweep) -> Sweep:
    """Return the sweep with the moment of its end for points without a time: not straightened, they are still in the way."""
    known = np.isfinite(sweep.times_s)
    if known.all():
        return sweep
    end_s = np.float32((sweep.end_ns - sweep.stamp_ns) / NS)
    return Sweep(sweep.stamp_ns, sweep.points, np.where(known, sweep.times_s, end_s))


@dataclass(frozen=True)
class _Around:
    """The returns around the way ahead.

    Attributes:
        near: those that may be an obstacle.
        ahead: how many come from each part of its view, from right to left, (VIEW_PARTS,).
        down: how many of the view come from below the way.
        level: how many of the view come from no more than LEVEL_DEG above or below it.
        seen: where all points of the sweep are from the vehicle, by one pose, (3, N) ahead, to the left and up.
        sensor: where that is from the vehicle, (3,).
    """

    near: Sweep
    ahead: NDArray[np.intp]
    down: int
    level: int
    seen: NDArray[np.float32]
    sensor: Floats

    def scattered(self, place: Floats) -> bool:
        """Return whether most returns at a place (3,) are at another range than those next to them in direction, and in no line.

        Rays that hit a thing end beside each other, or along it; a drop, a grain of dust or a foreign pulse ends one of them.
        """
        towards = place - self.sensor
        away_m = float(np.linalg.norm(towards))
        if away_m > SCATTERED_M:
            return False
        # From above first, which leaves a tenth of the sweep.
        level_m = max(float(np.hypot(*towards[:2])), NOTHING_M)
        ahead, left = (np.float32(value) for value in towards[:2] / level_m)
        x, y = self.seen[0] - np.float32(self.sensor[0]), self.seen[1] - np.float32(self.sensor[1])
        half = np.float32(PLACE_M / level_m + np.tan(BESIDE_RAD))
        window = np.flatnonzero(np.abs(ahead * y - left * x) <= half * (ahead * x + left * y))
        rays = self.seen.take(window, axis=1) - self.sensor.astype(np.float32)[:, None]
        ranges = np.sqrt(np.einsum("ij,ij->j", rays, rays))
        beside = (towards / away_m).astype(np.float32) @ rays > np.cos(np.arctan(PLACE_M / away_m) + BESIDE_RAD) * ranges
        rays, ranges = rays[:, beside], ranges[beside]
        of_place = np.flatnonzero(np.linalg.norm(rays - towards.astype(np.float32)[:, None], axis=0) < PLACE_M)
        if len(of_place) <= 2 or len(ranges) <= NEIGHBOURS:
            return False
        across_m = np.linalg.svd((rays[:, of_place] - rays[:, of_place].mean(axis=1, keepdims=True)).astype(np.float64), compute_uv=False)[
            1
        ]
        if across_m < IN_LINE_M * np.sqrt(len(of_place)):
            return False
        seeds = of_place[:: -(-len(of_place) // SEEDS)]
        directions = rays / np.maximum(ranges, np.float32(NOTHING_M))
        cosines = directions[:, seeds].T @ directions
        nearby = np.argpartition(-cosines, NEIGHBOURS, axis=1)[:, : NEIGHBOURS + 1]
        alike = np.abs(ranges[nearby] - ranges[seeds, None]) < ALIKE_M
        return bool(np.mean(np.count_nonzero(alike, axis=1) <= 1) > MOST_ALONE)


def _parts_of_view(ahead: NDArray[np.float32], left: NDArray[np.float32]) -> NDArray[np.intp]:
    part = (np.degrees(np.arctan2(left, ahead)) / VIEW_DEG + 1.0) * (VIEW_PARTS / 2.0)
    return np.bincount(np.clip(part.astype(np.intp), 0, VIEW_PARTS - 1), minlength=VIEW_PARTS)


def _not_seen(ahead: NDArray[np.intp]) -> str:
    if not ahead.any():
        return "the LiDAR does not look where the vehicle goes: 0 returns from there"
    worst = int(np.argmin(ahead))
    low, high = (VIEW_DEG * (2.0 * part / VIEW_PARTS - 1.0) for part in (worst, worst + 1))
    return f"the LiDAR does not see all of the way ahead: {ahead[worst]} returns from {low:+g} to {high:+g} degrees (left is positive)"


def _towards(direction: Floats, sectors: NDArray[np.bool_]) -> bool:
    """Return whether one of these sectors around the sensor's z axis looks along a direction (3,) in the sensor's frame."""
    if np.hypot(direction[0], direction[1]) < np.cos(np.radians(STEEP_DEG)):
        return False
    width_deg = 360.0 / len(sectors)
    middles_deg = (np.flatnonzero(sectors) + 0.5) * width_deg - 180.0
    aside_deg = (middles_deg - np.degrees(np.arctan2(direction[1], direction[0])) + 180.0) % 360.0 - 180.0
    return bool(np.any(np.abs(aside_deg) <= ASIDE_DEG))


def _along(direction: Floats) -> Floats:
    """Return the axes ahead, to the left and up of a horizontal direction (3,), the rows of (3, 3)."""
    return np.array([direction, [-direction[1], direction[0], 0.0], [0.0, 0.0, 1.0]])


def _axes(by_axis: NDArray[np.float32], rotation: Floats, origin: Floats) -> NDArray[np.float32]:
    """Return points (3, N), coordinate by coordinate, in another frame."""
    seen: NDArray[np.float32] = rotation.astype(np.float32) @ by_axis
    seen += origin.astype(np.float32)[:, None]
    return seen
