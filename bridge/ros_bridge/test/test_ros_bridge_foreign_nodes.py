"""`./alula bridge --all` beside nodes of others: types that can't be read, other versions of types, and names that ROS 2 can't have."""

import contextlib
import socket
import struct
import threading

import pytest
from bridge_test_interfaces.msg import Pose
from ros_bridge_harness import Ros1Peer
from std_msgs.msg import String

from alula_testing.waits import until
from bridge_tools.hostile import LENGTH, LOOPBACK, HostilePublisher
from bridge_tools.hostile import master as ask_master
from ros_bridge.ros1_definition import md5
from ros_bridge.tcpros import encode_header

CONFIG = "discover: {all: true}"
TYPE = "bridge_test_interfaces/Pose"


class HostileServer:
    """A service in ROS 1 whose node answers a probe with given fields."""

    def __init__(self, master_uri, service, **fields):
        self._reply = encode_header(fields)
        self._listener = socket.create_server((LOOPBACK, 0))
        self._uri, self._service, self._master_uri = f"rosrpc://{LOOPBACK}:{self._listener.getsockname()[1]}", service, master_uri
        threading.Thread(target=self._serve, daemon=True).start()
        with ask_master(master_uri) as proxy:
            proxy.registerService("/hostile", service, self._uri, f"http://{LOOPBACK}:9/")

    def _serve(self):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                with connection, contextlib.suppress(OSError):
                    connection.recv(LENGTH.unpack(connection.recv(4, socket.MSG_WAITALL))[0], socket.MSG_WAITALL)
                    connection.sendall(self._reply)

    def close(self):
        with contextlib.suppress(OSError), ask_master(self._master_uri) as proxy:
            proxy.unregisterService("/hostile", self._service, self._uri)
        self._listener.close()


def told(bridge, *words):
    return [line for line in bridge.lines if all(word in line for word in words)]


def test_what_can_not_be_read_is_refused_once_and_another_topic_crosses(master, bridge, ros1, ros2_node):
    hostile = [
        HostileServer(master.uri, "/fo/a_probe", type="AddTwoInts", md5sum="x"),
        HostileServer(master.uri, "/fo/a_sum", type="std_srvs/SetBool", md5sum="0" * 32),
    ]
    for number, (name, text) in enumerate([(TYPE, "No part"), (TYPE, "int32 a\n---"), ("x-y/Pose", "int32 a")]):
        reply = encode_header({"type": name, "md5sum": md5(str(number)), "message_definition": text, "callerid": "/h", "latching": "0"})
        hostile.append(HostilePublisher(master.uri, f"/fo/a{number}", name, name=f"/h{number}", reply=reply, talk=lambda _: None))
    until(lambda: told(bridge, "/fo/a_probe", "'AddTwoInts' is no name of a type"), "the probe is refused")
    until(lambda: told(bridge, "/fo/a_sum", "MD5 sum 0000", "ROS_BRIDGE_ROS1_SHARE"), "the sum is told")
    until(lambda: told(bridge, "/fo/a2", "'x-y/Pose' is no name of a type"), "the name is refused")
    received = ros2_node.subscribe("/fo/after", String)
    ros1.do("advertise", topic="/fo/after", type="std_msgs/String")

    def arrives():
        ros1.do("publish", topic="/fo/after", values={"data": "after"})
        return received

    ros2_node.until(arrives, "another topic crosses")
    assert len(told(bridge, "/fo/a_probe")) == 1
    assert not told(bridge, "discovery restarts")
    for one in hostile:
        one.close()


VERSIONS = [
    ("float32 x\nfloat32 y\nfloat32 theta\nfloat32 linear_velocity\nfloat32 angular_velocity", struct.pack("<5f", 1, 2, 3, 4, 5)),
    ("float32 theta\nfloat32 x\nfloat32 y", struct.pack("<3f", 3, 1, 2)),
]


@pytest.mark.parametrize("versions", [VERSIONS, VERSIONS[::-1]])
def test_a_driver_that_comes_back_with_another_version_is_bridged(master, bridge, ros2_node, versions):
    """The files have the one version; the other one is known from the driver alone."""
    topic = f"/fo/driver{VERSIONS.index(versions[0])}"
    received = ros2_node.subscribe(topic, Pose)
    for definition, content in versions:
        driver = Ros1Peer(master)
        driver.do("advertise_own", topic=topic, type=TYPE, definition=definition)

        def arrives(driver=driver, content=content):
            driver.do("publish_bytes", topic=topic, hex=content.hex())
            return received

        ros2_node.until(arrives, "it crosses")
        assert (received[-1].x, received[-1].y, received[-1].theta) == (1.0, 2.0, 3.0)
        driver.close()
        received.clear()


def test_a_subscriber_of_another_version_gets_messages_of_its_own(master, bridge, ros2_node):
    subscriber = Ros1Peer(master)
    definition, content = "float32 y\nfloat32 theta", struct.pack("<2f", 2, 3)  # no other node here has said it
    subscriber.do("subscribe_own", topic="/fo/down", type=TYPE, definition=definition)
    publisher = ros2_node.publisher("/fo/down", Pose)

    def arrives():
        publisher.publish(Pose(x=1.0, y=2.0, theta=3.0))
        return any(content.hex() in line for line in subscriber.lines)

    ros2_node.until(arrives, "it crosses")
    subscriber.close()
