"""The LiDAR's health, and the nearest obstacle ahead of the motion from its sweeps. The node is in ``lidar_obstacles.node``."""

from lidar_obstacles.ahead import Body, LidarAhead, LidarAheadSettings
from lidar_obstacles.cloud_health import CloudJudge, CloudLimits
from lidar_obstacles.ground import GroundModel, GroundSettings
from lidar_obstacles.mounting import MountCheck
from lidar_obstacles.settings import LidarSettings

__all__ = [
    "Body",
    "CloudJudge",
    "CloudLimits",
    "GroundModel",
    "GroundSettings",
    "LidarAhead",
    "LidarAheadSettings",
    "LidarSettings",
    "MountCheck",
]
