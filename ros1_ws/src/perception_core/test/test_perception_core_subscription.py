"""A subscription through what a publisher can do wrong on the wire."""

from __future__ import annotations

import struct

import pytest
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import String

from alula_testing.ros1 import wait_until
from perception_core.ros import RawSubscriber
from perception_core.testing import framed, send_raw


@pytest.fixture
def link(ros_master):
    heard: list[float] = []
    garbage: list[str] = []
    publisher = rospy.Publisher("/raw/point", Point, queue_size=10)
    subscriber = RawSubscriber("/raw/point", Point, lambda message: heard.append(message.x), garbage.append, buffer_bytes=1 << 16)
    wait_until(publisher.get_num_connections, timeout_s=15.0, what="connected")
    yield publisher, heard, garbage
    subscriber.close()
    publisher.unregister()


def test_a_message_cut_short_is_told_and_the_next_one_is_heard(link) -> None:
    publisher, heard, garbage = link
    send_raw(publisher, framed(struct.pack("<d", 1.0) + b"half"))
    publisher.publish(Point(x=2.0))
    wait_until(lambda: heard == [2.0], timeout_s=15.0, what="the message after it")
    assert len(garbage) <= 1  # of messages that wait, only the newest is decoded
    send_raw(publisher, framed(struct.pack("<d", 1.0) + b"half"))
    wait_until(lambda: bool(garbage), timeout_s=15.0, what="the cut message is told")
    assert garbage[0].startswith("a message of 12 bytes can't be decoded")


def test_a_stream_that_lost_its_borders_is_connected_anew(link) -> None:
    publisher, heard, _ = link
    send_raw(publisher, struct.pack("<I", 2**31) + b"the rest never comes")

    def publish_and_hear() -> bool:
        publisher.publish(Point(x=3.0))
        return bool(heard)

    wait_until(publish_and_hear, timeout_s=30.0, what="messages on a new connection")


def test_another_type_is_told(ros_master) -> None:
    garbage: list[str] = []
    publisher = rospy.Publisher("/raw/other", String, queue_size=10, latch=True)
    publisher.publish(String("x"))
    subscriber = RawSubscriber("/raw/other", rospy.AnyMsg, lambda _message: None, garbage.append, buffer_bytes=1 << 16)
    wait_until(lambda: bool(garbage), timeout_s=15.0, what="told")
    assert garbage[0] == "/raw/other carries std_msgs/String, expected *"
    subscriber.close()
    publisher.unregister()
