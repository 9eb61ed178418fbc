"""The node /lidar_obstacles: its core on ROS."""

from __future__ import annotations

import rospy

from lidar_obstacles.core import OUTPUTS, LidarObstacles
from lidar_obstacles.settings import LidarSettings
from node_core.ros import RosHost
from perception_core.ros import TunableSettings, read_settings


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("lidar_obstacles")
    settings = read_settings(LidarSettings())
    host = RosHost(OUTPUTS, "perception")
    core = LidarObstacles(settings, host)
    _tuning = TunableSettings(settings, core.tune)
    host.run(core)
    rospy.spin()
