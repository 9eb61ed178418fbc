"""Health's node: its core on ROS."""

from __future__ import annotations

import rospy
from node_core.ros import RosHost

from rover_navigation.health_core import NAME, OUTPUTS, SKILLSETS, Health


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node(NAME)
    host = RosHost(OUTPUTS, *SKILLSETS)
    host.run(Health(host))
    rospy.spin()
