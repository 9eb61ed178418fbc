"""From a sweep to the nearest obstacle ahead of the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidar_obstacles.ground import ASIDE_M, BEHIND_M, GroundModel, GroundSettings
from perception_core import NS, Ahead, Corridor, Motion, PoseBuffer, Support, Sweep, deskew, direction_of_motion, nearest_obstacle
from perception_core.corridor import corridor_coordinates

Floats = NDArray[np.float64]
BLUR_M = 1.0  # by as much at most a point is moved when its sweep is straightened, within the region that is looked at
VIEW_DEG = 25.0  # the sensor sees the way ahead if it has returns within this angle of it, seen from above ...
STEEP_DEG = 60.0  # ... that are not below or above the vehicle
ASIDE_DEG = 20.0  # from the way ahead to the middle of a sector that lost its returns; an obstacle at 4 m may be as far aside


@dataclass(frozen=True)
class Body:
    """The vehicle: a cylinder around base_link's z axis. Returns from inside it are its own."""

    radius_m: float = 1.0
    half_height_m: float = 0.6


@dataclass(frozen=True)
class AheadSettings:
    """Where to look, what to believe, what is the vehicle itself and what is ground.

    With fewer than ``min_ahead`` returns from the direction of the motion, near or far, it is unknown what is there.
    """

    corridor: Corridor
    support: Support
    body: Body
    ground: GroundSettings
    min_ahead: int = 3


class LidarAhead:
    """Look ahead by sweeps in their order; not thread-safe."""

    def __init__(self, settings: AheadSettings) -> None:
        self._settings = settings
        self._ground = GroundModel(settings.ground)

    def look(
        self,
        sweep: Sweep,
        *,
        T_base_lidar: Floats,  # noqa: N803 -- T_target_source
        poses: PoseBuffer,
        motion: Motion,
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
        points = deskew(around.near, poses, T_base_lidar)
        seen = corridor_coordinates(points, position, direction)
        heights = self._ground.heights(seen, points, position, direction)
        nearest = nearest_obstacle(points, position, direction, settings.corridor, settings.support, heights_m=heights)
        if nearest is None and around.ahead < settings.min_ahead:
            return Ahead(None, f"the LiDAR does not look where the vehicle goes: {around.ahead} returns from there")
        if nearest is None and gone is not None and _towards(direction @ pose[:3, :3] @ T_base_lidar[:3, :3], gone):
            return Ahead(None, "the LiDAR has just lost its returns from where the vehicle goes")
        return Ahead(nearest)

    def _around(self, sweep: Sweep, pose: Floats, T_base_lidar: Floats, direction: Floats) -> _Around:  # noqa: N803 -- T_target_source
        """Select the returns around the way ahead, by one pose for all; the vehicle's own are left out."""
        body = self._settings.body
        usable = sweep.within(0.05, float("inf"))
        x, y, z = _axes(usable.points, T_base_lidar[:3, :3], T_base_lidar[:3, 3])
        own = (x * x + y * y <= body.radius_m**2) & (np.abs(z) <= body.half_height_m)
        axes = np.array([direction, [-direction[1], direction[0], 0.0], [0.0, 0.0, 1.0]]) @ pose[:3, :3]
        ahead, left, up = _axes(usable.points, axes @ T_base_lidar[:3, :3], axes @ T_base_lidar[:3, 3])
        flat = ahead * ahead + left * left  # squared, as all that is compared with it: a root of each point costs as much as the rest
        in_view = (ahead >= 0.0) & (ahead * ahead >= np.cos(np.radians(VIEW_DEG)) ** 2 * flat)
        towards = in_view & (up * up <= np.tan(np.radians(STEEP_DEG)) ** 2 * flat) & ~own
        length_m = self._settings.corridor.length_m
        near = (ahead >= -BEHIND_M - BLUR_M) & (ahead <= length_m + BLUR_M) & (np.abs(left) <= ASIDE_M + BLUR_M) & ~own
        return _Around(near=usable.select(near), ahead=int(np.count_nonzero(towards)))


def _timed(sweep: Sweep) -> Sweep:
    """Return the sweep with the moment of its end for points without a time: not straightened, they are still in the way."""
    known = np.isfinite(sweep.times_s)
    if known.all():
        return sweep
    end_s = np.float32((sweep.end_ns - sweep.stamp_ns) / NS)
    return Sweep(sweep.stamp_ns, sweep.points, np.where(known, sweep.times_s, end_s))


@dataclass(frozen=True)
class _Around:
    near: Sweep
    ahead: int


def _towards(direction: Floats, sectors: NDArray[np.bool_]) -> bool:
    """Return whether one of these sectors around the sensor's z axis looks along a direction (3,) in the sensor's frame."""
    if np.hypot(direction[0], direction[1]) < np.cos(np.radians(STEEP_DEG)):
        return False
    width_deg = 360.0 / len(sectors)
    middles_deg = (np.flatnonzero(sectors) + 0.5) * width_deg - 180.0
    aside_deg = (middles_deg - np.degrees(np.arctan2(direction[1], direction[0])) + 180.0) % 360.0 - 180.0
    return bool(np.any(np.abs(aside_deg) <= ASIDE_DEG))


def _axes(points: NDArray[np.float32], rotation: Floats, origin: Floats) -> NDArray[np.float32]:
    """Return the points (N, 3) in another frame, coordinate by coordinate, (3, N)."""
    seen: NDArray[np.float32] = rotation.astype(np.float32) @ points.T
    seen += origin.astype(np.float32)[:, None]
    return seen
