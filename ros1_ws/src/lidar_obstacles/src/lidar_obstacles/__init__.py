"""The nearest obstacle ahead of the motion from the LiDAR's sweeps. The node is in ``lidar_obstacles.node``."""

from lidar_obstacles.ahead import AheadSettings, CloudJudge, obstacle_ahead
from lidar_obstacles.settings import LidarSettings

__all__ = ["AheadSettings", "CloudJudge", "LidarSettings", "obstacle_ahead"]
