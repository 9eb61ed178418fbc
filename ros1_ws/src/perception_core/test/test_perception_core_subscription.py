"""A subscription through what a publisher can do wrong on the wire."""

from __future__ import annotations

import struct

import pytest
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import String

from alula_testing.ros1 import wait_until
from perception_core.ros import RawSubscriber, subscription
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


def test_a_stream_that_lost_its_borders_is_connected_again(link) -> None:
    publisher, heard, _ = link
    send_raw(publisher, struct.pack("<I", 2**31) + b"the rest never comes")

    def publish_and_hear() -> bool:
        publisher.publish(Point(x=3.0))
        return bool(heard)

    wait_until(publish_and_hear, timeout_s=30.0, what="messages on a new connection")


def test_a_held_clock_is_no_silence(ros_master, monkeypatch) -> None:
    """Simulated time waits for slow nodes: no message is due, so the connections stay as they are."""
    now_s, looks = [5.0], []
    monkeypatch.setattr(subscription, "LOOK_S", 0.01)
    monkeypatch.setattr(subscription, "SILENCE_S", 0.2)
    monkeypatch.setattr(rospy, "get_time", lambda: (looks.append(1), now_s[0])[1])
    subscribed: list[str] = []
    subscribe = RawSubscriber._subscribe
    monkeypatch.setattr(RawSubscriber, "_subscribe", lambda self: (subscribed.append(self._topic), subscribe(self))[1])
    publisher = rospy.Publisher("/raw/held", Point, queue_size=10)
    subscriber = RawSubscriber("/raw/held", Point, lambda _message: None, lambda _why: None, buffer_bytes=1 << 16)
    wait_until(publisher.get_num_connections, timeout_s=15.0, what="connected")
    looks.clear()
    wait_until(lambda: len(looks) > 50, timeout_s=15.0, what="50 looks, half a second of wall clock")
    assert len(subscribed) == 1
    now_s[0] += 0.2
    wait_until(lambda: len(subscribed) == 2, timeout_s=15.0, what="connected again when the clock has gone on")
    subscriber.close()
    publisher.unregister()


def test_another_type_is_told(ros_master) -> None:
    garbage: list[str] = []
    publisher = rospy.Publisher("/raw/other", String, queue_size=10, latch=True)
    publisher.publish(String("x"))
    subscriber = RawSubscriber("/raw/other", rospy.AnyMsg, lambda _message: None, garbage.append, buffer_bytes=1 << 16)
    wait_until(lambda: bool(garbage), timeout_s=15.0, what="told")
    assert garbage[0] == "/raw/other carries std_msgs/String, expected *"
    subscriber.close()
    publisher.unregister()
