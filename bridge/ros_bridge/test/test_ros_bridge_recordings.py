"""Recordings made by others, played through the bridge both ways: each message is compared with what rosbags alone makes of it."""

import importlib
import struct
from collections import Counter

import pytest
from rclpy.qos import QoSProfile
from ros_bridge_harness import Ros1Peer, bag_folder
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

CONFIG = """
discover: {all: true}
types:
  messages:
    - {ros1: turtlesim/Color, ros2: bridge_test_interfaces/Color}
    - {ros1: turtlesim/Pose, ros2: bridge_test_interfaces/Pose}
"""
BAGS = {"embag_luminar_pointcloud2.bag": 15, "foxglove_turtlesim.bag": 8647, "robot_localization_test1.bag": 16806}
# At a time; fewer than the depth of a discovered route (100; 10 for clouds, of which the recording has five), so that none has to give way.
LOT = 80
IN_ROS2 = {
    "rosgraph_msgs/Log": "rcl_interfaces/Log",
    "tf/tfMessage": "tf2_msgs/TFMessage",
    "turtlesim/Color": "bridge_test_interfaces/Color",
    "turtlesim/Pose": "bridge_test_interfaces/Pose",
}
BACK_IN_ROS1 = {"tf/tfMessage": "tf2_msgs/TFMessage"}


def full(name):
    return name.replace("/", "/msg/")


class Reference:
    """A recorded type as rosbags alone converts it, without any code of the bridge."""

    def __init__(self, kind, text):
        self.kind = kind
        self.ros1, self.ros2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
        self.name = full(IN_ROS2.get(kind, kind))
        if self.name not in self.ros2.fielddefs:
            self.name = full(kind)
            self.ros2.register(get_types_from_msg(text, self.name))
        self.headed = self.ros2.fielddefs[self.name][1][0][0] == "header" or kind == "rosgraph_msgs/Log"

    def to_ros2(self, data):
        if self.kind != "rosgraph_msgs/Log":
            return bytes(self.ros2.ros1_to_cdr(data, self.name))
        log = self.ros1.deserialize_ros1(data, full(self.kind))
        fields = (log.header.stamp, log.level, log.name, log.msg, log.file, log.function, log.line)
        return bytes(self.ros2.serialize_cdr(self.ros2.types[self.name](*fields), self.name))

    def to_ros1(self, cdr):
        if self.kind != "rosgraph_msgs/Log":
            return bytes(self.ros2.cdr_to_ros1(cdr, self.name))
        log = self.ros2.deserialize_cdr(cdr, self.name)
        header = self.ros1.types["std_msgs/msg/Header"](0, log.stamp, "")
        fields = (header, log.level, log.name, log.msg, log.file, log.function, log.line, [])
        return bytes(self.ros1.serialize_ros1(self.ros1.types[full(self.kind)](*fields), full(self.kind)))


class Way:
    """One recorded topic on its way to ROS 2 under a name and back to ROS 1 under another."""

    def __init__(self, topic, reference, ros2_node, player, stem):
        self.there, self.back = f"/{stem}/there{topic}", f"/{stem}/back{topic}"
        self.reference = reference
        self.recorded = []
        self.compared = 0
        package, name = IN_ROS2.get(reference.kind, reference.kind).split("/")
        kind = getattr(importlib.import_module(f"{package}.msg"), name)
        self.arrived = ros2_node.subscribe(self.there, kind, QoSProfile(depth=1000), raw=True)
        self.publisher = ros2_node.publisher(self.back, kind, QoSProfile(depth=1000))
        player.do("subscribe_raw", topic=self.back)

    def compare_in_ros2(self, number):
        """Compare the next messages in ROS 2 with the recorded ones, and send them back as they are."""
        for cdr, data in zip(self.arrived[self.compared :], self.recorded[self.compared : self.compared + number], strict=True):
            wanted = self.reference.to_ros2(data)
            assert bytes(cdr) == wanted + bytes(len(cdr) - len(wanted))  # DDS fills up to four bytes
            assert len(cdr) - len(wanted) < 4
            self.publisher.publish(bytes(cdr))

    def compare_in_ros1(self, event):
        """Compare a message that has returned: what the route counts in ``header.seq``, and all other bytes."""
        returned, data = bytes.fromhex(event["hex"]), self.recorded[self.compared]
        wanted = self.reference.to_ros1(bytes(self.arrived[self.compared]))
        self.compared += 1
        if self.reference.headed:
            wanted, data = (struct.pack("<I", self.compared) + one[4:] for one in (wanted, data))
        assert returned == wanted
        kind = self.reference.kind
        assert event["type"] == BACK_IN_ROS1.get(kind, kind)
        if kind not in {"rosgraph_msgs/Log", "tf/tfMessage"}:  # these lose what ROS 2 has no place for: topics, each transform's seq
            assert returned == data


@pytest.mark.parametrize("name", BAGS)
def test_recordings_of_others_cross_both_ways_byte_for_byte(name, ros2_node, master, bridge):
    """From ROS 1 to ROS 2 as they were recorded; what arrives is sent back under another name, and has to be the recorded bytes."""
    path = bag_folder() / name
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    player = Ros1Peer(master)
    ways, order = {}, []
    with Reader(path) as reader:
        for connection, _, data in reader.messages():
            if connection.topic not in ways:
                reference = Reference(connection.msgtype.replace("/msg/", "/"), connection.msgdef.data)
                ways[connection.topic] = Way(connection.topic, reference, ros2_node, player, path.stem)
            ways[connection.topic].recorded.append(bytes(data))
            order.append(connection.topic)
    player.do("advertise_bag", path=str(path), prefix=f"/{path.stem}/there")
    assert player.expect("advertised")["number"] == len(order) == BAGS[name]
    for way in ways.values():
        wait_open(player, ros2_node, way)
    of_back = {way.back: way for way in ways.values()}
    for start in range(0, len(order), LOT):
        numbers = Counter(order[start : start + LOT])
        player.do("play", number=LOT)
        for topic, number in numbers.items():
            way = ways[topic]
            wanted = way.compared + number
            ros2_node.until(lambda way=way, wanted=wanted: len(way.arrived) >= wanted, f"{wanted} of {topic} arrive")
            way.compare_in_ros2(number)
        for _ in range(numbers.total()):
            event = player.expect("message")
            of_back[event["topic"]].compare_in_ros1(event)
    assert all(way.compared == len(way.arrived) == len(way.recorded) for way in ways.values())


def wait_open(player, ros2_node, way):
    """Wait until the bridge is connected to both ends that messages come from; it connects to those that receive before."""

    def connected():
        player.do("connections", topic=way.there)
        return player.expect("connections", topic=way.there)["number"] and way.publisher.get_subscription_count()

    ros2_node.until(connected, f"the bridge is connected to {way.there} and {way.back}")
