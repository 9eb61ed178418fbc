"""A node of ROS 1 beside a robot's simulator: writes down where the robot truly is, a JSON line a pose: ``truth_watch FILE ROBOT BEATS``.

``{"at_s", "stamp_s", "x", "y", "z", "theta"}``: monotonic clock of the machine and simulated time (s), metres and radians in the world's
frame; a line ``{"at_s", "collisions"}`` at each word of the simulator's state, and ``{"at_s", "beat": true}`` at each heartbeat of the
managers that move the robot (topic BEATS), as it comes to the base. ROBOT: rover or drone.
"""

from __future__ import annotations

import json
import math
import sys
import time
from pathlib import Path
from typing import IO

import rospy
from geometry_msgs.msg import Pose, PoseStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import String


def main() -> None:
    """Write until the node is shut down."""
    rospy.init_node("truth_watch")
    path, robot, beats = rospy.myargv(sys.argv)[1:]
    with Path(path).open("w", buffering=1, encoding="utf-8") as file:
        if robot == "drone":
            state = "/sim/state"
            rospy.Subscriber("/sim/true_pose", PoseStamped, lambda told: _write(file, **_pose_of(told, told.pose)))
        else:
            state = "/truth/state"
            rospy.Subscriber("/truth/odom", Odometry, lambda told: _write(file, **_pose_of(told, told.pose.pose)))
        rospy.Subscriber(state, String, lambda told: _write(file, collisions=json.loads(told.data)["collisions"]))
        rospy.Subscriber(beats, rospy.AnyMsg, lambda _: _write(file, beat=True), tcp_nodelay=True)
        rospy.spin()


def _pose_of(told: PoseStamped | Odometry, pose: Pose) -> dict[str, float]:
    at, q = pose.position, pose.orientation
    yaw_rad = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    return {"stamp_s": told.header.stamp.to_sec(), "x": at.x, "y": at.y, "z": at.z, "theta": yaw_rad}


def _write(file: IO[str], **values: float) -> None:
    file.write(json.dumps({"at_s": time.monotonic(), **values}) + "\n")


if __name__ == "__main__":
    main()
