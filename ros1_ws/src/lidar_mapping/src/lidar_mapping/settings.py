"""The node's parameters, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass

from lidar_mapping.mapper import MapperSettings
from lidar_mapping.registration import RegistrationSettings


@dataclass(frozen=True)
class MappingSettings:
    """Private parameters of /lidar_mapping with their defaults; units in the names."""

    enabled: bool = False
    map_path: str = "map.ply"
    resume: bool = True
    every_scan: int = 1
    save_period_s: float = 10.0
    publish_period_s: float = 2.0
    voxel_m: float = 0.1
    max_voxels: int = 1_000_000
    self_m: float = 1.2
    max_range_m: float = 20.0
    max_correction_m: float = 0.3
    min_fitness: float = 0.3

    @property
    def mapper(self) -> MapperSettings:
        """How the map is made."""
        return MapperSettings(
            voxel_m=self.voxel_m,
            max_voxels=self.max_voxels,
            self_m=self.self_m,
            max_range_m=self.max_range_m,
            registration=RegistrationSettings(max_correction_m=self.max_correction_m, min_fitness=self.min_fitness),
        )
