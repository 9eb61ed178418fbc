"""Topics through the bridge as a process, between a ROS master with a rospy peer and a DDS domain with this process as rclpy peer."""

import json
import os
import signal
import struct

from geometry_msgs.msg import PoseStamped
from rclpy.serialization import deserialize_message, serialize_message
from ros_bridge_harness import Ros1Peer
from ros_bridge_nodes import LATCHED, open_up, wait_for_figures, wait_ros1_receives
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from uav_msgs.msg import GuidanceState

from alula_testing.waits import until
from ros_bridge.conversion import Types, ament_prefixes

CONFIG = """
topics:
  - {name: /clock, direction: ros1_to_ros2, type: rosgraph_msgs/Clock, depth: 200}
  - {name: /bt/up, direction: ros1_to_ros2, type: std_msgs/String, depth: 200}
  - {name: /bt/down, direction: ros2_to_ros1, type: std_msgs/String, depth: 200}
  - {name: /bt/up_latched, direction: ros1_to_ros2, type: std_msgs/String, latched: true, depth: 1}
  - {name: /bt/down_latched, direction: ros2_to_ros1, type: std_msgs/String, latched: true, depth: 1}
  - {ros1_name: /bt/state_up, ros2_name: /bt/renamed_up, direction: ros1_to_ros2, type: uav_msgs/GuidanceState}
  - {name: /bt/state_down, direction: ros2_to_ros1, type: uav_msgs/GuidanceState}
  - {name: /bt/pose_down, direction: ros2_to_ros1, type: geometry_msgs/PoseStamped, depth: 3}
"""
STATE = {
    "header": {"stamp": {"secs": 3, "nsecs": 4}, "frame_id": "map"},
    "mode": "GUIDED",
    "landed_state": 2,
    "authority": True,
    "position_enu_m": {"x": 1.5, "y": -2.5, "z": 3.25},
    "reference": "position",
    "reference_id": 4_000_000_000,
    "obstacle_m": 1e300,
}


def test_every_message_of_a_burst_crosses_to_ros2_in_order(ros1, ros2):
    received = open_up(ros1, ros2, "/bt/up", String, "std_msgs/String")
    texts = [f"ü{number}" for number in range(50)]
    for text in texts:
        ros1.do("publish", topic="/bt/up", values={"data": text})
    until(lambda: received[-1].data == texts[-1], "the last one arrives")
    assert [message.data for message in received if message.data] == texts


def test_every_message_of_a_burst_crosses_to_ros1_in_order(ros1, ros2):
    publisher = ros2.publisher("/bt/down", String, 200)
    ros1.do("subscribe", topic="/bt/down", type="std_msgs/String")
    wait_ros1_receives(ros1, publisher, "/bt/down")
    for number in range(50):
        publisher.publish(String(data=f"ü{number}"))
    for number in range(50):
        event = ros1.expect("message", topic="/bt/down")
        text = f"ü{number}".encode()
        assert bytes.fromhex(event["hex"]) == struct.pack("<I", len(text)) + text
        assert not event["latched"]


def test_late_joiner_in_ros2_gets_the_latched_message(ros1, ros2):
    ros1.do("advertise", topic="/bt/up_latched", type="std_msgs/String", latch=True)
    ros1.do("publish", topic="/bt/up_latched", values={"data": "old"})
    ros1.do("publish", topic="/bt/up_latched", values={"data": "the last"})
    first = ros2.subscribe("/bt/up_latched", String, LATCHED)
    until(lambda: first and first[-1].data == "the last", "the first late joiner gets it")
    second = ros2.subscribe("/bt/up_latched", String, LATCHED)
    until(lambda: second, "the second late joiner gets it too")
    assert [message.data for message in second] == ["the last"]


def test_late_joiner_in_ros1_gets_the_transient_local_message(ros1, ros2, master):
    publisher = ros2.publisher("/bt/down_latched", String, LATCHED)
    publisher.publish(String(data="kept"))
    wanted = (struct.pack("<I", 4) + b"kept").hex()
    ros1.do("subscribe", topic="/bt/down_latched", type="std_msgs/String")
    assert ros1.expect("message", topic="/bt/down_latched", hex=wanted)["latched"]
    later = Ros1Peer(master)
    later.do("subscribe", topic="/bt/down_latched", type="std_msgs/String")
    later.expect("message", topic="/bt/down_latched", hex=wanted)
    later.close()


def test_clock_crosses_whole_and_in_order(ros1, ros2, bridge):
    received = open_up(ros1, ros2, "/clock", Clock, "rosgraph_msgs/Clock")
    for tick in range(1, 101):
        ros1.do("publish", topic="/clock", values={"clock": {"secs": tick, "nsecs": 5}})
    until(lambda: received[-1].clock.sec == 100, "the last tick arrives")
    ticks = [(message.clock.sec, message.clock.nanosec) for message in received if message.clock.sec]
    assert ticks == [(tick, 5) for tick in range(1, 101)]
    figures = wait_for_figures(bridge, "/clock", 100)
    assert figures["p50_ms"] is not None
    assert figures["dropped"] == figures["errors"] == 0


def test_custom_type_crosses_to_ros2_byte_for_byte_under_another_name(ros1, ros2):
    received = open_up(
        ros1, ros2, "/bt/state_up", GuidanceState, "uav_msgs/GuidanceState", ros2_topic="/bt/renamed_up", values=STATE, raw=True
    )
    sent = bytes.fromhex(ros1.expect("published", topic="/bt/state_up")["hex"])
    message = deserialize_message(received[0], GuidanceState)
    assert message.position_enu_m.y == -2.5
    assert message.reference_id == 4_000_000_000
    returned = bytes(Types(ament_prefixes()).message("uav_msgs/GuidanceState").to_ros1(serialize_message(message)))
    assert returned[4:].hex() == sent[4:].hex()


def test_custom_type_crosses_to_ros1_byte_for_byte_with_its_own_sequence(ros1, ros2):
    publisher = ros2.publisher("/bt/state_down", GuidanceState)
    ros1.do("subscribe", topic="/bt/state_down", type="uav_msgs/GuidanceState")
    wait_ros1_receives(ros1, publisher, "/bt/state_down")
    state = GuidanceState(mode="LAND", reference="land", yaw_rad=0.5, obstacle_m=float("inf"), heading_locked=True)
    state.header.frame_id = "map"
    state.header.stamp.sec = 77
    publisher.publish(state)
    wanted = bytes(Types(ament_prefixes()).message("uav_msgs/GuidanceState").to_ros1(serialize_message(state)))
    before = None
    while True:
        received = bytes.fromhex(ros1.expect("message", topic="/bt/state_down")["hex"])
        sequence = struct.unpack("<I", received[:4])[0]
        assert before is None or sequence == before + 1
        before = sequence
        if received[4:] == wanted[4:]:
            break


def test_publisher_of_another_type_is_refused_and_the_route_lives(ros1, ros2, master):
    wrong = Ros1Peer(master)
    wrong.do("advertise", topic="/bt/up", type="std_msgs/Float64")
    wrong.do("publish", topic="/bt/up", values={"data": 1.0})
    received = open_up(ros1, ros2, "/bt/up", String, "std_msgs/String", values={"data": "good"})
    wrong.do("connections", topic="/bt/up")
    assert wrong.expect("connections")["number"] == 0
    assert {message.data for message in received} == {"good"}
    wrong.close()


def test_heartbeat_in_both_worlds(ros1, ros2):
    beats = ros2.subscribe("/ros_bridge/state", String, LATCHED)
    ros1.do("subscribe", topic="/ros_bridge/state", type="std_msgs/String")
    until(lambda: len(beats) >= 3, "three heartbeats in ROS 2")
    states = [json.loads(beat.data) for beat in beats[:3]]
    assert [state["sequence"] - states[0]["sequence"] for state in states] == [0, 1, 2]
    assert {state["state"] for state in states} == {"running"}
    assert states[0]["ros1_master"] is True
    text = bytes.fromhex(ros1.expect("message", topic="/ros_bridge/state")["hex"])[4:]
    assert json.loads(text)["topics"] == 8


def test_subscriber_that_does_not_read_loses_the_oldest_and_stalls_no_other(ros2, master, bridge):
    """A stopped ROS 1 process: its socket fills up, drops are counted, the other subscriber gets everything."""
    stopped, alive = Ros1Peer(master), Ros1Peer(master)
    publisher = ros2.publisher("/bt/pose_down", PoseStamped)
    for peer in (stopped, alive):
        peer.do("subscribe", topic="/bt/pose_down", type="geometry_msgs/PoseStamped")
        wait_ros1_receives(peer, publisher, "/bt/pose_down")
    os.killpg(stopped.process.pid, signal.SIGSTOP)
    big = PoseStamped()
    big.header.frame_id = "x" * 1_000_000
    for number in range(20):
        big.pose.position.x = float(number)
        publisher.publish(big)
        while True:  # probes of wait_ros1_receives may be in between
            received = bytes.fromhex(alive.expect("message", topic="/bt/pose_down")["hex"])
            if len(received) > 1_000_000:
                break
        assert struct.unpack("<d", received[-56:-48])[0] == number
    until(lambda: wait_for_figures(bridge, "/bt/pose_down", 20)["dropped"] > 0, "drops are counted")
    os.killpg(stopped.process.pid, signal.SIGCONT)
    stopped.close()
    alive.close()
