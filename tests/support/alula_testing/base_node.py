"""A base's node for tests, in ROS 1: ``base_node.py WHAT...``; each WHAT is something that it does.

odometry=HZ         publishes /rover/odom so often, from the start on
other_odometry      the same at 20 Hz, as a version of the type with another MD5 sum
wheels[=TYPE]       listens to /rover/cmd_vel, as Twist or as TYPE of std_msgs
reporter            has a ResourceReporter of the skillset rover
states              follows the states of the skillset rover, and reports nothing
"""

from __future__ import annotations

import sys

import rospy
import std_msgs.msg
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from skillset_interfaces.msg import ResourceStates

from resource_reporter import ResourceReporter


def main() -> None:
    """Do what the command line says until the node is shut down."""
    words = dict(word.partition("=")[::2] for word in rospy.myargv(sys.argv)[1:])
    rospy.init_node("base", anonymous=True)
    if "other_odometry" in words:
        Odometry._md5sum = "0" * 32
        words["odometry"] = "20"
    if "odometry" in words:
        publisher = rospy.Publisher("/rover/odom", Odometry, queue_size=5)
        rospy.Timer(rospy.Duration.from_sec(1.0 / float(words["odometry"])), lambda _: publisher.publish(Odometry()))
    if "wheels" in words:
        rospy.Subscriber("/rover/cmd_vel", getattr(std_msgs.msg, words["wheels"]) if words["wheels"] else Twist, lambda _: None)
    if "reporter" in words:
        ResourceReporter("rover").report("bumper", "CLEAR")
    if "states" in words:
        rospy.Subscriber("/rover/resource_states", ResourceStates, lambda _: None)
    rospy.spin()


if __name__ == "__main__":
    main()
