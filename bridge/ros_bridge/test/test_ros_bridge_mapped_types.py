"""Types that the worlds lay out differently, through the bridge as a process: topics and services, both ways, and what can't be read."""

import json
import struct

from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from ros_bridge_harness import PROBE_S
from ros_bridge_nodes import open_up, wait_ros1_receives
from ros_bridge_wire import FakePublisher, header
from std_msgs.msg import Float64
from uav_msgs.srv import Takeoff

from alula_testing.waits import until

CONFIG = """
types:
  messages:
    - {ros1: std_msgs/Float32, ros2: std_msgs/Float64, fields: {data: data}}
    - {ros1: geometry_msgs/PoseStamped, ros2: geometry_msgs/PoseStamped, fields: {pose: pose}}
    - {ros1: std_srvs/SetBool_Request, ros2: uav_msgs/Takeoff_Request, fields: {data: height_m}}
    - {ros1: std_srvs/SetBool_Response, ros2: uav_msgs/Takeoff_Response, fields: {success: accepted, message: reason}}
  services:
    - {ros1: std_srvs/SetBool, ros2: uav_msgs/Takeoff}
topics:
  - {name: /bm/up, direction: ros1_to_ros2, type: std_msgs/Float32, depth: 100}
  - {name: /bm/fake, direction: ros1_to_ros2, type: std_msgs/Float32, depth: 100}
  - {name: /bm/down, direction: ros2_to_ros1, type: std_msgs/Float32, depth: 100}
  - {name: /bm/latched, direction: ros1_to_ros2, type: std_msgs/Float32, latched: true, depth: 1}
  - {name: /bm/pose, direction: ros2_to_ros1, type: geometry_msgs/PoseStamped, depth: 100}
services:
  - {name: /bm/in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 10.0}
  - {name: /bm/unserved, server: ros1, type: std_srvs/SetBool, timeout_s: 0.5}
  - {name: /bm/in_ros2, server: ros2, type: std_srvs/SetBool, timeout_s: 10.0}
"""
FLOAT32_SUM = "73fcbf46b49191e672908e50842a83d4"


def test_a_burst_keeps_its_order_both_ways(ros1, ros2):
    received = open_up(ros1, ros2, "/bm/up", Float64, "std_msgs/Float32", values={"data": -1.0})
    publisher = ros2.publisher("/bm/down", Float64)
    ros1.do("subscribe", topic="/bm/down", type="std_msgs/Float32")
    wait_ros1_receives(ros1, publisher, "/bm/down")
    numbers = [0.5 + number for number in range(50)]
    for number in numbers:
        ros1.do("publish", topic="/bm/up", values={"data": number})
        publisher.publish(Float64(data=number))
    until(lambda: received[-1].data == numbers[-1], "the last one arrives")
    assert [message.data for message in received if message.data > 0] == numbers
    for number in numbers:
        ros1.expect("message", topic="/bm/down", hex=struct.pack("<f", number).hex())


def test_late_joiner_gets_the_latched_message(ros1, ros2):
    latched = QoSProfile(depth=1, durability=1)
    ros1.do("advertise", topic="/bm/latched", type="std_msgs/Float32", latch=True)
    ros1.do("publish", topic="/bm/latched", values={"data": 2.5})
    early = ros2.subscribe("/bm/latched", Float64, latched)
    until(lambda: early, "it crosses")
    late = ros2.subscribe("/bm/latched", Float64, latched)
    until(lambda: late, "a late joiner gets it")
    assert late[0].data == 2.5


def test_headers_are_numbered_towards_ros1(ros1, ros2):
    ros1.do("subscribe", topic="/bm/pose", type="geometry_msgs/PoseStamped")
    publisher = ros2.publisher("/bm/pose", PoseStamped)
    wait_ros1_receives(ros1, publisher, "/bm/pose")
    for _ in range(3):
        publisher.publish(PoseStamped())
    numbers = [struct.unpack_from("<I", bytes.fromhex(ros1.expect("message", topic="/bm/pose")["hex"]))[0] for _ in range(3)]
    assert numbers == list(range(numbers[0], numbers[0] + 3))
    assert numbers[0] > 0


def test_a_message_that_is_none_is_counted_and_the_next_one_crosses(ros2, master, bridge):
    received = ros2.subscribe("/bm/fake", Float64)
    hello = header(callerid="/fake", type="std_msgs/Float32", md5sum=FLOAT32_SUM, latching="0", topic="/bm/fake")
    bad, good = struct.pack("<I", 2) + b"xx", struct.pack("<If", 4, 1.5)
    fake = FakePublisher(master, [hello + bad + good], topic="/bm/fake", type_name="std_msgs/Float32")
    until(lambda: received, "the good one arrives", every_s=PROBE_S)
    fake.close()
    assert {message.data for message in received} == {1.5}

    def counted():
        return bridge.stats_file.is_file() and json.loads(bridge.stats_file.read_text())["topics"]["/bm/fake"]["errors"] > 0

    until(counted, "the bad one is counted")


def test_ros2_client_calls_a_ros1_server(ros1, ros2):
    ros1.do("serve", service="/bm/in_ros1", type="std_srvs/SetBool", behaviour="echo")
    for height_m, accepted in ((1.0, True), (0.0, False)):
        response = ros2.call("/bm/in_ros1", Takeoff, Takeoff.Request(height_m=height_m))
        assert (response.accepted, response.reason) == (accepted, "from ROS 1")


def test_ros2_client_gets_a_refusal_without_a_server(ros2, bridge):
    response = ros2.call("/bm/unserved", Takeoff, Takeoff.Request(height_m=1.0))
    assert response.accepted is False
    assert "no server" in response.reason


def test_ros1_client_calls_a_ros2_server(ros1, ros2):
    heights = []

    def rise(request, response):
        heights.append(request.height_m)
        response.accepted, response.reason, response.reference_id = True, "it rises", 7
        return response

    server = ros2.node.create_service(Takeoff, "/bm/in_ros2", rise)
    ros2.ends.append((ros2.node.destroy_service, server))
    ros1.do("call", service="/bm/in_ros2", type="std_srvs/SetBool", values={"data": True})
    assert ros1.expect("called", "call_failed")["text"] == 'success: True\nmessage: "it rises"'
    assert heights == [1.0]
