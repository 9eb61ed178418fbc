"""The mapping procedure: straighten a sweep, register it against what is known around, add it to the map."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.registration import Registration, RegistrationSettings, Surface, register
from lidar_mapping.voxel_map import VoxelMap, downsample
from perception_core import PoseBuffer, Sweep, deskew

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class MapperSettings:
    """How the map is made; metres.

    The surface to register against is what the map holds within ``local_m``, where it is flatter than ``flat_m``; it is made anew every
    ``refresh_scans`` scans, because its normals are the costly part. The first ``warm_up_scans`` are taken as the poses put them: their
    mean is what the rest is laid onto.
    """

    voxel_m: float = 0.1
    max_voxels: int = 1_000_000
    self_m: float = 1.2
    max_range_m: float = 20.0
    scan_voxel_m: float = 0.3
    local_m: float = 15.0
    local_voxel_m: float = 0.3
    normal_radius_m: float = 0.6
    flat_m: float = 0.05
    refresh_scans: int = 5
    warm_up_scans: int = 5
    registration: RegistrationSettings = field(default_factory=RegistrationSettings)


@dataclass
class MapperCount:
    """What was done so far."""

    scans: int = 0
    rejected: int = 0


class Mapper:
    """Build one map from sweeps; not thread-safe."""

    def __init__(self, settings: MapperSettings) -> None:
        self._settings = settings
        self.map = VoxelMap(voxel_m=settings.voxel_m, max_voxels=settings.max_voxels)
        self.count = MapperCount()
        self._surface: Surface | None = None
        self._since_refresh = 0

    def add(self, sweep: Sweep, poses: PoseBuffer, T_base_lidar: NDArray[np.float64]) -> Registration:  # noqa: N803 -- T_target_source
        """Map one sweep and return how its registration went; raise PoseUnavailableError, then nothing was changed.

        A registration that is not believed leaves the sweep where the given pose puts it.
        """
        near = sweep.within(self._settings.self_m, self._settings.max_range_m)
        points = deskew(near, poses, T_base_lidar)
        position = poses.at([sweep.end_ns]).position[0]
        registration = self._register(points, position)
        if registration.believed:
            points = points @ registration.T_corrected_given[:3, :3].T + registration.T_corrected_given[:3, 3]
        self.map.insert(points)
        self._since_refresh += 1
        return registration

    def _register(self, points: NDArray[np.float64], position: NDArray[np.float64]) -> Registration:
        surface = self._local_surface(position)
        self.count.scans += 1
        if surface is None:
            return Registration(np.eye(4), 0.0, 0.0, 0.0, "there is no map yet")
        near = downsample(points[_within(points, position, self._settings.local_m)], self._settings.scan_voxel_m)
        registration = register(near, position, surface, self._settings.registration)
        self.count.rejected += not registration.believed
        return registration

    def _local_surface(self, position: NDArray[np.float64]) -> Surface | None:
        """Return the map around the vehicle with normals, None until the first scans are in."""
        s = self._settings
        if self.count.scans < s.warm_up_scans:
            return None
        if self._surface is None or self._since_refresh >= s.refresh_scans:
            known = self.map.points
            around = downsample(known[_within(known, position, s.local_m)], s.local_voxel_m)
            self._surface = Surface(around, normal_radius_m=s.normal_radius_m, flat_m=s.flat_m)
            self._since_refresh = 0
        return self._surface


def _within(points: NDArray[np.float64], centre: NDArray[np.float64], reach_m: float) -> NDArray[np.bool_]:
    """Return which points (N, 3) are in the upright cylinder around the centre."""
    away = points[:, :2] - centre[:2]
    inside: NDArray[np.bool_] = np.einsum("ij,ij->i", away, away) <= reach_m**2
    return inside
