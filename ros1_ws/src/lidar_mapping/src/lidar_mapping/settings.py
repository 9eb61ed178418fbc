"""The node's parameters, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lidar_mapping.graph import GraphSettings
from lidar_mapping.odometry import OdometrySettings
from lidar_mapping.slam import SlamSettings

_SLAM, _ODOMETRY, _GRAPH = SlamSettings(), OdometrySettings(), GraphSettings()


@dataclass(frozen=True)
class MappingSettings:
    """Private parameters of /lidar_mapping with their defaults; units in the names."""

    enabled: bool = False
    map_path: str = "map.ply"
    resume: bool = True
    every_scan: int = 1
    save_period_s: float = 10.0
    publish_period_s: float = 2.0
    voxel_m: float = _SLAM.voxel_m
    max_voxels: int = _SLAM.max_voxels
    self_m: float = _SLAM.self_m
    max_range_m: float = _SLAM.max_range_m
    lost_s: float = _SLAM.lost_s
    lost_m: float = _SLAM.lost_m
    reach_m: float = _ODOMETRY.reach_m
    scan_voxel_m: float = _ODOMETRY.scan_voxel_m
    max_keyframes: int = _ODOMETRY.max_keyframes
    min_fitness: float = _ODOMETRY.registration.min_fitness
    autopilot_m_s: float = _ODOMETRY.autopilot_m_s
    autopilot_tilt_rad: float = _ODOMETRY.noise.autopilot_tilt_rad
    autopilot_heading_rad: float = _ODOMETRY.noise.autopilot_heading_rad
    autopilot_drift: float = _ODOMETRY.noise.autopilot_drift
    loop_reach_m: float = _GRAPH.reach_m
    autopilot_m: float = _GRAPH.autopilot_m

    @property
    def slam(self) -> SlamSettings:
        """How the map is made."""
        registration = replace(_ODOMETRY.registration, min_fitness=self.min_fitness)
        noise = replace(
            _ODOMETRY.noise,
            autopilot_tilt_rad=self.autopilot_tilt_rad,
            autopilot_heading_rad=self.autopilot_heading_rad,
            autopilot_drift=self.autopilot_drift,
        )
        odometry = replace(
            _ODOMETRY,
            reach_m=self.reach_m,
            scan_voxel_m=self.scan_voxel_m,
            max_keyframes=self.max_keyframes,
            autopilot_m_s=self.autopilot_m_s,
            noise=noise,
            registration=registration,
        )
        return replace(
            _SLAM,
            voxel_m=self.voxel_m,
            max_voxels=self.max_voxels,
            self_m=self.self_m,
            max_range_m=self.max_range_m,
            lost_s=self.lost_s,
            lost_m=self.lost_m,
            odometry=odometry,
            graph=replace(_GRAPH, reach_m=self.loop_reach_m, autopilot_m=self.autopilot_m),
        )
