"""A node of ROS 1 beside the rover's simulator: writes down where the rover truly is, a JSON line a pose: ``truth_watch FILE``.

``{"at_s", "stamp_s", "x", "y", "theta"}``: monotonic clock of the machine and simulated time (s), metres and radians in the world's frame;
a line ``{"at_s", "collisions"}`` at each word of the simulator's state, and ``{"at_s", "beat": true}`` at each heartbeat of the managers
that move the rover, as it comes to the base.
"""

from __future__ import annotations

import json
import math
import sys
import time
from pathlib import Path
from typing import IO

import rospy
from nav_msgs.msg import Odometry
from std_msgs.msg import String


def main() -> None:
    """Write until the node is shut down."""
    rospy.init_node("truth_watch")
    with Path(rospy.myargv(sys.argv)[1]).open("w", buffering=1, encoding="utf-8") as file:
        rospy.Subscriber("/truth/odom", Odometry, lambda told: _write(file, **_pose_of(told)))
        rospy.Subscriber("/truth/state", String, lambda told: _write(file, collisions=json.loads(told.data)["collisions"]))
        rospy.Subscriber("/base/alive", rospy.AnyMsg, lambda _: _write(file, beat=True), tcp_nodelay=True)
        rospy.spin()


def _pose_of(told: Odometry) -> dict[str, float]:
    at, turned = told.pose.pose.position, told.pose.pose.orientation
    return {"stamp_s": told.header.stamp.to_sec(), "x": at.x, "y": at.y, "theta": 2.0 * math.atan2(turned.z, turned.w)}


def _write(file: IO[str], **values: float) -> None:
    file.write(json.dumps({"at_s": time.monotonic(), **values}) + "\n")


if __name__ == "__main__":
    main()
