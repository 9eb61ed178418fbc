"""The drone's part of a replay from sensors: the cores of zed_depth, lidar_obstacles and lidar_mapping perceive a flight again."""

from __future__ import annotations

from collections.abc import Mapping

import lidar_mapping.core
import lidar_obstacles.core
import zed_depth.core
from lidar_mapping.settings import MappingSettings
from lidar_obstacles.settings import LidarSettings
from node_core import Core
from node_core.replay import Replayed, SensorPart
from perception_core.ros.settings import override
from uav_flight.sensor_faults import WAYS
from zed_depth.settings import ZedSettings

ZED, OBSTACLES, MAPPING = NODES = ("zed_depth", "lidar_obstacles", "lidar_mapping")
MEASURED = {
    "/zed/left/image_raw": "zed",
    "/zed/right/image_raw": "zed",
    "/zed/left/camera_info": "zed",
    "/zed/right/camera_info": "zed",
    "/lidar/points": "lidar",
    "/imu/data": "imu",
}
REPORTS = {
    "perception.zed_status": ("/zed/left/image_raw", "/zed/right/image_raw"),
    "perception.lidar_status": ("/lidar/points",),
    "mapping.slam_status": ("/lidar/points",),
    "mapping.height_status": ("/lidar/points",),
    "mapping.imu_status": ("/lidar/points",),
}


def make(replay: Replayed) -> Mapping[str, Core]:
    """Make the cores, with their parameters."""
    zed = override(ZedSettings(), replay.settings(ZED))
    obstacles = override(LidarSettings(), replay.settings(OBSTACLES))
    mapping = override(MappingSettings(map_path=str(replay.folder / "map.ply")), replay.settings(MAPPING))
    return {
        ZED: zed_depth.core.ZedDepth(zed, replay.host(ZED, zed_depth.core.OUTPUTS)),
        OBSTACLES: lidar_obstacles.core.LidarObstacles(obstacles, replay.host(OBSTACLES, lidar_obstacles.core.OUTPUTS)),
        MAPPING: lidar_mapping.core.LidarMapping(mapping, replay.host(MAPPING, lidar_mapping.core.OUTPUTS)),
    }


SENSORS = SensorPart(MEASURED, REPORTS, NODES, make, WAYS, left_out=frozenset(MEASURED))
