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
    """whether it maps from the start; else `~enable` begins it"""
    map_path: str = "map.ply"
    """where the map is saved, PLY"""
    resume: bool = True
    """go on with the map of that file, if there is one"""
    every_scan: int = 1
    """of which one is mapped: 1, each"""
    save_period_s: float = 10.0
    """between two saved maps"""
    publish_period_s: float = 2.0
    """between two published maps"""
    voxel_m: float = _SLAM.voxel_m
    """edge of the map's voxels"""
    max_voxels: int = _SLAM.max_voxels
    """of the map; a full map is said"""
    self_m: float = _SLAM.self_m
    """from `base_link`: returns from nearer are the vehicle's own"""
    max_range_m: float = _SLAM.max_range_m
    """of returns that are used"""
    lost_s: float = _SLAM.lost_s
    """without a scan that fits until the map is LOST"""
    lost_m: float = _SLAM.lost_m
    """deviation of the position from which on the map is LOST"""
    reach_m: float = _ODOMETRY.reach_m
    """within which what keyframes saw is the surface that scans are laid on"""
    scan_voxel_m: float = _ODOMETRY.scan_voxel_m
    """to which scans are thinned"""
    max_keyframes: int = _ODOMETRY.max_keyframes
    """that are kept; 0.6 m or 0.2 rad apart"""
    min_fitness: float = _ODOMETRY.registration.min_fitness
    """share of a scan that lies on the surface, or it is refused"""
    autopilot_m_s: float = _ODOMETRY.autopilot_m_s
    """to which the autopilot's velocity is believed, but for its drift"""
    autopilot_tilt_rad: float = _ODOMETRY.noise.autopilot_tilt_rad
    """error of its attitude about each horizontal axis, which changes within 30 s"""
    autopilot_heading_rad: float = _ODOMETRY.noise.autopilot_heading_rad
    """error of its heading, which changes within 30 s"""
    autopilot_drift: float = _ODOMETRY.noise.autopilot_drift
    """of the way: drift of its position along each axis, which changes within 60 s"""
    loop_reach_m: float = _GRAPH.reach_m
    """within which a keyframe is held against one that lies 25 m of flight back"""
    autopilot_m: float = _GRAPH.autopilot_m
    """to which its position is believed"""

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
