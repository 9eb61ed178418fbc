"""The bridge of a robot that lies in a namespace of ROS 2, beside others: ROS 1's names are below it there."""

import json
import struct

from diagnostic_msgs.msg import DiagnosticArray
from ros_bridge_nodes import LATCHED, open_up, wait_ros1_receives
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import SetBool

from alula_testing.waits import until

CONFIG = """
topics:
  - {name: /clock, direction: ros1_to_ros2, type: rosgraph_msgs/Clock}
  - {name: /bn/up, direction: ros1_to_ros2, type: std_msgs/String}
  - {name: /bn/down, direction: ros2_to_ros1, type: std_msgs/String}
  - {ros1_name: /bn/own, ros2_name: /shared/own, direction: ros1_to_ros2, type: std_msgs/String}
services:
  - {name: /bn/in_ros1, server: ros1, type: std_srvs/SetBool}
discover: {include: [/bn/found]}
"""
ARGUMENTS = ("--ros-args", "-r", "__ns:=/rover", "-r", "/clock:=/rover/clock")


def test_names_of_ros1_are_below_the_namespace_in_ros2_and_nowhere_else(ros1, ros2):
    open_up(ros1, ros2, "/bn/up", String, "std_msgs/String", ros2_topic="/rover/bn/up")
    open_up(ros1, ros2, "/bn/found", String, "std_msgs/String", ros2_topic="/rover/bn/found")
    ros1.do("advertise", topic="/clock", type="rosgraph_msgs/Clock")
    ticks = ros2.subscribe("/rover/clock", Clock)

    def ticked():
        ros1.do("publish", topic="/clock", values={"clock": {"secs": 7}})
        return ticks

    until(ticked, "the clock comes")
    names = ("/clock", "/bn/up", "/bn/found", "/bn/down", "/ros_bridge/state", "/diagnostics")
    ends = [end for name in names for end in ros2.node.get_publishers_info_by_topic(name)]
    assert not [end.topic_type for end in ends if end.node_namespace == "/rover"]
    assert ("ros_bridge", "/rover") in ros2.node.get_node_names_and_namespaces()


def test_a_topic_of_the_namespace_reaches_ros1_and_one_of_that_name_outside_does_not(ros1, ros2):
    outside = ros2.node.create_publisher(String, "/bn/down", 10)
    outside.publish(String(data="of another robot"))
    publisher = ros2.publisher("/rover/bn/down", String)
    ros1.do("subscribe", topic="/bn/down", type="std_msgs/String")
    wait_ros1_receives(ros1, publisher, "/bn/down")
    outside.publish(String(data="of another robot"))
    publisher.publish(String(data="mine"))
    assert bytes.fromhex(ros1.expect("message", topic="/bn/down")["hex"]) == struct.pack("<I", 4) + b"mine"
    assert outside.get_subscription_count() == 0
    ros2.node.destroy_publisher(outside)


def test_a_name_that_is_given_for_ros2_stays_what_it_is(ros1, ros2):
    open_up(ros1, ros2, "/bn/own", String, "std_msgs/String", ros2_topic="/shared/own")


def test_a_service_is_called_in_the_namespace(ros1, ros2):
    ros1.do("serve", service="/bn/in_ros1", type="std_srvs/SetBool")
    assert ros2.call("/rover/bn/in_ros1", SetBool, SetBool.Request(data=True)) is not None


def test_what_the_bridge_tells_of_itself_is_in_the_namespace(ros1, ros2):
    beats = ros2.subscribe("/rover/ros_bridge/state", String, LATCHED)
    told = ros2.subscribe("/rover/diagnostics", DiagnosticArray)
    until(lambda: beats and told, "state and diagnostics come")
    assert json.loads(beats[-1].data)["state"] == "running"
