"""The node /zed_depth: its core on ROS."""

from __future__ import annotations

import cv2
import rospy

from node_core.ros import RosHost
from perception_core.ros import TunableSettings, read_settings
from zed_depth.core import OUTPUTS, ZedDepth
from zed_depth.settings import ZedSettings


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("zed_depth")
    settings = read_settings(ZedSettings())
    cv2.setNumThreads(settings.threads)
    host = RosHost(OUTPUTS, "perception")
    core = ZedDepth(settings, host)
    _tuning = TunableSettings(settings, core.tune)
    host.run(core)
    rospy.spin()
