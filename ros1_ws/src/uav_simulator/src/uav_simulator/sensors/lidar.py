"""A spinning LiDAR of 16 beams whose scan plane is across the direction of flight; each column is cast from the pose of its moment."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_simulator.sensors.mounts import GEAR_M, LIDAR
from uav_simulator.sensors.pose_track import PoseTrack
from uav_simulator.world.scene import NO_HIT, Scene

Floats = NDArray[np.float64]
POINT_DTYPE = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("time", "<f4")])


@dataclass(frozen=True)
class LidarSpec:
    """Beams evenly within +-15 degrees of the scan plane, 720 columns a turn, ten turns a second."""

    beams: int = 16
    half_angle_deg: float = 15.0
    columns: int = 720
    period_s: float = 0.1
    min_range_m: float = 0.4
    max_range_m: float = 25.0
    noise_m: float = 0.02


class Lidar:
    """Scans a world along a track of poses."""

    def __init__(self, world: Scene, seed: int, spec: LidarSpec | None = None, *, noise_m: float = 0.0) -> None:
        """``noise_m``: standard deviation of the ranges on top of the specification's."""
        self.spec = spec or LidarSpec()
        self._noise_m = math.hypot(self.spec.noise_m, noise_m)
        self._world = world
        self._rng = np.random.default_rng([seed, 5])
        spec = self.spec
        azimuth = np.arange(spec.columns) * (2.0 * math.pi / spec.columns)
        elevation = np.radians(np.linspace(-spec.half_angle_deg, spec.half_angle_deg, spec.beams))
        a, e = np.meshgrid(azimuth, elevation, indexing="ij")
        self._directions = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])  # (3, columns, beams), sensor
        self._offsets_s: Floats = np.linspace(0.0, spec.period_s, spec.columns, endpoint=False, dtype=np.float64)
        self._body_directions = np.einsum("ij,jcb->cbi", LIDAR.matrix, self._directions)
        self._normals = np.ascontiguousarray(world.normals.T)

    def scan(self, track: PoseTrack, start_s: float) -> NDArray[np.void]:
        """Return the returns of the sweep that began at ``start_s``: POINT_DTYPE in the sensor's frame at each point's own time."""
        positions, rotations = track.at(start_s + self._offsets_s)
        rays = np.empty((*self._body_directions.shape[:2], 6), dtype=np.float32)
        # Axis by axis: numpy is several times as slow along rows of three.
        for axis, origin in enumerate((positions + rotations @ np.asarray(LIDAR.translation)).T):
            rays[..., axis] = origin[:, None]
        rays[..., 2] = np.maximum(rays[..., 2], GEAR_M)
        rays[..., 3:] = self._body_directions @ rotations.transpose(0, 2, 1)
        hits = self._world.cast(rays)
        spec = self.spec
        seen = np.flatnonzero((hits.triangle != NO_HIT) & (hits.range_m >= spec.min_range_m) & (hits.range_m <= spec.max_range_m))
        triangles = hits.triangle.take(seen)
        ranges = hits.range_m.take(seen) + self._rng.normal(0.0, self._noise_m, len(seen))
        facing = np.zeros(len(seen))
        for normal, direction in zip(self._normals, rays.reshape(-1, 6).T[3:], strict=True):
            facing += normal.take(triangles) * direction.take(seen)
        points = np.empty(len(seen), dtype=POINT_DTYPE)
        for name, direction in zip(("x", "y", "z"), self._directions, strict=True):
            points[name] = direction.take(seen) * ranges
        points["intensity"] = 255.0 * self._world.brightness[triangles] * np.abs(facing)
        points["time"] = self._offsets_s.take(seen // spec.beams)
        return points
