"""A subscription through what a publisher can do wrong on the wire."""

from __future__ import annotations

import socket
import struct
from threading import Thread
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rosgraph
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import String

from alula_testing.waits import HANGS_S, until
from node_core.core import Input
from node_core.ros import RawSubscriber, subscription, warn_of_garbage
from perception_core.testing import framed, send_raw

BUFFER_BYTES = 1 << 16


@pytest.fixture
def link(ros_master):
    heard: list[float] = []
    garbage: list[str] = []
    publisher = rospy.Publisher("/raw/point", Point, queue_size=10)
    subscriber = RawSubscriber(Input("/raw/point", Point, lambda message: heard.append(message.x), garbage.append, BUFFER_BYTES))
    until(publisher.get_num_connections, what="connected")
    yield publisher, heard, garbage
    subscriber.close()
    publisher.unregister()


def test_a_message_cut_short_is_told_and_the_next_one_is_heard(link) -> None:
    publisher, heard, garbage = link
    send_raw(publisher, framed(struct.pack("<d", 1.0) + b"half"))
    publisher.publish(Point(x=2.0))
    until(lambda: heard == [2.0], what="the message after it")
    assert len(garbage) <= 1  # of messages that wait, only the newest is decoded
    send_raw(publisher, framed(struct.pack("<d", 1.0) + b"half"))
    until(lambda: bool(garbage), what="the cut message is told")
    assert garbage[0].startswith("a message of 12 bytes can't be decoded")


def test_a_stream_that_lost_its_borders_is_connected_again(link) -> None:
    publisher, heard, _ = link
    send_raw(publisher, struct.pack("<I", 2**31) + b"the rest never comes")

    def publish_and_hear() -> bool:
        publisher.publish(Point(x=3.0))
        return bool(heard)

    until(publish_and_hear, what="messages on a new connection")


class Watched:
    """A subscription on a clock that the test moves; how often its watch looked at the clock, and how often it subscribed."""

    def __init__(self, monkeypatch) -> None:
        self.now_s, self.looks, self.subscribed = 5.0, 0, 0
        monkeypatch.setattr(subscription, "LOOK_S", 0.01)
        monkeypatch.setattr(subscription, "SILENCE_S", 0.2)
        monkeypatch.setattr(rospy, "get_time", self._time)
        subscribe = RawSubscriber._subscribe
        monkeypatch.setattr(RawSubscriber, "_subscribe", lambda subscriber: (self._count(), subscribe(subscriber))[1])

    def _time(self) -> float:
        self.looks += 1
        return self.now_s

    def _count(self) -> None:
        self.subscribed += 1

    def look(self) -> None:
        """Wait until the watch has looked 50 times, half a second of wall clock."""
        self.looks = 0
        until(lambda: self.looks > 50, what="50 looks")


@pytest.fixture
def watched(ros_master, monkeypatch):
    return Watched(monkeypatch)


def test_a_held_clock_is_no_silence(watched) -> None:
    """Simulated time waits for slow nodes: no message is due, so the connections stay as they are."""
    publisher = rospy.Publisher("/raw/held", Point, queue_size=10)
    subscriber = RawSubscriber(Input("/raw/held", Point, lambda _message: None, lambda _why: None, BUFFER_BYTES))
    until(publisher.get_num_connections, what="connected")
    send_raw(publisher, struct.pack("<I", 24) + b"the rest is due")
    watched.look()
    assert watched.subscribed == 1
    watched.now_s += 0.2
    until(lambda: watched.subscribed == 2, what="connected again when the clock has gone on")
    subscriber.close()
    publisher.unregister()


def test_a_topic_that_is_silent_by_nature_is_left_alone(watched) -> None:
    """A latched topic says once what it has to say."""
    heard: list[float] = []
    publisher = rospy.Publisher("/raw/latched", Point, queue_size=10, latch=True)
    publisher.publish(Point(x=4.0))
    subscriber = RawSubscriber(Input("/raw/latched", Point, lambda message: heard.append(message.x), warn_of_garbage, BUFFER_BYTES))
    until(lambda: heard == [4.0], what="the latched message")
    for _ in range(3):
        watched.now_s += 100.0
        watched.look()
    assert watched.subscribed == 1
    publisher.publish(Point(x=5.0))
    until(lambda: heard == [4.0, 5.0], what="the next message")
    subscriber.close()
    publisher.unregister()


def test_a_publisher_that_has_said_nothing_yet_is_left_alone(watched) -> None:
    """A sensor that is switched on later: its first message must find a connection."""
    heard: list[float] = []
    publisher = rospy.Publisher("/raw/later", Point, queue_size=10)
    subscriber = RawSubscriber(Input("/raw/later", Point, lambda message: heard.append(message.x), warn_of_garbage, BUFFER_BYTES))
    until(publisher.get_num_connections, what="connected")
    for _ in range(3):
        watched.now_s += 100.0
        watched.look()
    assert watched.subscribed == 1
    publisher.publish(Point(x=6.0))
    until(lambda: heard == [6.0], what="the first message")
    subscriber.close()
    publisher.unregister()


def test_a_publisher_that_has_gone_when_the_connection_stands_publishes_nothing_until_it_is_back(ros_master) -> None:
    """Its node refuses the connection: rospy gives up, and keeps the connection all the same."""
    with socket.create_server(("127.0.0.1", 0)) as port, SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False) as node:
        node.register_function(lambda *_asked: [1, "", ["TCPROS", "127.0.0.1", port.getsockname()[1]]], "requestTopic")
        Thread(target=node.serve_forever, daemon=True).start()
        uri = f"http://127.0.0.1:{node.server_address[1]}/"
        rosgraph.Master("/gone").registerPublisher("/raw/gone", "geometry_msgs/Point", uri)
        subscriber = RawSubscriber(Input("/raw/gone", Point, lambda _message: None, warn_of_garbage, BUFFER_BYTES))
        connection, _ = port.accept()
        assert subscriber.published
        connection.sendall(framed(framed(b"error=/gone is not a publisher of [/raw/gone]")))
        connection.close()
        rosgraph.Master("/gone").unregisterPublisher("/raw/gone", uri)
        until(lambda: not subscriber.published, what="rospy has given up", timeout_s=20.0)
        rosgraph.Master("/gone").registerPublisher("/raw/gone", "geometry_msgs/Point", uri)
        port.settimeout(HANGS_S)
        port.accept()[0].close()
        subscriber.close()
        node.shutdown()


def test_a_driver_that_goes_and_is_back_at_once_is_heard(ros_master) -> None:
    """Its node's address is the same: rospy takes it for the publisher that it is connected to, until it has seen that connection end."""
    heard: list[float] = []
    subscriber = RawSubscriber(Input("/raw/back", Point, lambda message: heard.append(message.x), warn_of_garbage, BUFFER_BYTES))
    for life in range(5):
        publisher = rospy.Publisher("/raw/back", Point, queue_size=10)
        until(publisher.get_num_connections, what="connected")
        publisher.publish(Point(x=life))
        until(lambda life=life: heard[-1:] == [life], what="a message")
        publisher.unregister()
    subscriber.close()


def test_another_type_is_told(ros_master) -> None:
    garbage: list[str] = []
    publisher = rospy.Publisher("/raw/other", String, queue_size=10, latch=True)
    publisher.publish(String("x"))
    subscriber = RawSubscriber(Input("/raw/other", rospy.AnyMsg, lambda _message: None, garbage.append, BUFFER_BYTES))
    until(lambda: bool(garbage), what="told")
    assert garbage[0] == "/raw/other carries std_msgs/String, expected *"
    subscriber.close()
    publisher.unregister()


def test_a_look_between_bytes_and_their_message_rebuilds_nothing_however_far_the_clock_has_run() -> None:
    stream = subscription.Stream()
    looks = [(0, 1), (70, 2), (70, 3), (0, 3), (70, 3), (0, 4), (70, 4)]  # bytes of a message that is under way at some looks
    assert not any(stream.lost(*so_far, 10.0 * k) for k, so_far in enumerate(looks))


def test_a_stream_without_messages_is_lost_after_its_timeout_which_doubles_until_one_comes() -> None:
    stream = subscription.Stream()
    assert not stream.lost(0, 1, 0.0)
    assert [stream.lost(10 * k, 1, 0.5 * k) for k in range(1, 6)] == [False] * 4 + [True]
    assert [stream.lost(10 * k, 0, 10.0 + 0.5 * k) for k in range(1, 11)] == [False] * 8 + [True, False]
    assert not stream.lost(0, 3, 30.0)
    assert [stream.lost(10 * k, 3, 30.0 + 0.5 * k) for k in range(1, 6)] == [False] * 4 + [True]
    assert not any(stream.lost(0, 0, 40.0 + k) for k in range(20)), "where no bytes wait nothing is wrong"
