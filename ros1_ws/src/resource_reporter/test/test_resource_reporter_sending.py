"""Sending directly: all messages, whole and in order, however slowly a subscriber takes them."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest
import rospy
from rospy.exceptions import TransportTerminated
from rospy.impl.tcpros_base import TCPROSTransport, TCPROSTransportProtocol
from rospy.topics import _PublisherImpl
from std_msgs.msg import String

from alula_testing.waits import until
from resource_reporter import send_directly
from resource_reporter.sending import DirectConnection

LARGE = 1 << 23  # more than a socket takes at once


@pytest.fixture(params=[None, 1e5])
def ends(request: pytest.FixtureRequest) -> Iterator[tuple[TCPROSTransport, socket.socket]]:
    """A publisher's transport, and the other end of its socket; rospy's sockets have a timeout or none."""
    ours, theirs = socket.socketpair()
    ours.settimeout(request.param)
    theirs.settimeout(None)
    transport = TCPROSTransport(TCPROSTransportProtocol("test", None), "test")
    transport.set_socket(ours, "test")
    yield transport, theirs
    transport.close()
    theirs.close()


def read(theirs: socket.socket, count: int) -> bytes:
    """Return so many bytes."""
    data = bytearray()
    while len(data) < count:
        data += theirs.recv(count - len(data))
    return bytes(data)


def test_what_the_socket_takes_is_sent_by_the_caller(ends: tuple[TCPROSTransport, socket.socket]) -> None:
    transport, theirs = ends
    connection = DirectConnection(transport, 1)
    for number in range(10):
        connection.write_data(b"%3d" % number)
    theirs.setblocking(False)  # all is there already
    assert theirs.recv(1000) == b"".join(b"%3d" % number for number in range(10))
    assert (transport.stat_bytes, transport.stat_num_msg) == (30, 10)


def test_nobody_waits_for_a_subscriber_that_takes_nothing(ends: tuple[TCPROSTransport, socket.socket]) -> None:
    transport, theirs = ends
    connection = DirectConnection(transport, 0)  # all are kept
    for number in range(5000):
        connection.write_data(b"%5d" % number)  # hangs where it waits
    assert read(theirs, 25_000) == b"".join(b"%5d" % number for number in range(5000))


def test_a_message_that_was_begun_is_ended_and_the_newest_of_those_behind_it_follow(
    ends: tuple[TCPROSTransport, socket.socket],
) -> None:
    transport, theirs = ends
    connection = DirectConnection(transport, 2)
    connection.write_data(b"x" * LARGE)
    for letter in b"abcdef":
        connection.write_data(bytes([letter]) * LARGE)
    first = read(theirs, LARGE)
    assert first == b"x" * LARGE
    # The thread may have taken some of them before they were left out for newer ones; what comes is whole and in order, the newest last.
    letters = b""
    while not letters.endswith(b"f"):
        message = read(theirs, LARGE)
        assert message == message[:1] * LARGE
        letters += message[:1]
    assert list(letters) == sorted(set(letters))
    connection.write_data(b"end")
    assert read(theirs, 3) == b"end"


def test_one_that_has_gone_is_told_to_the_publisher(ends: tuple[TCPROSTransport, socket.socket]) -> None:
    transport, theirs = ends
    connection = DirectConnection(transport, 1)
    theirs.close()
    connection.write_data(b"lost")
    until(lambda: transport.done, "the thread finds out")
    with pytest.raises(TransportTerminated):
        connection.write_data(b"told")


@pytest.mark.parametrize(("subscriber", "heard"), [("/unnamed", b"end"), ("/other", b"wordend")])
def test_a_node_does_not_send_to_itself_what_it_does_not_want_to_hear(
    ends: tuple[TCPROSTransport, socket.socket], monkeypatch: pytest.MonkeyPatch, subscriber: str, heard: bytes
) -> None:
    transport, theirs = ends
    monkeypatch.setattr(DirectConnection, "not_heard", frozenset({"/tf"}))
    monkeypatch.setattr(rospy, "get_name", lambda: "/unnamed")
    transport.name, transport.endpoint_id = "/tf", subscriber
    assert DirectConnection(transport, 1).write_data(b"word")
    transport.write_data(b"end")
    assert read(theirs, len(heard)) == heard


def test_publishers_of_rospy_send_so(ends: tuple[TCPROSTransport, socket.socket]) -> None:
    send_directly()
    publisher = _PublisherImpl("/test", String)
    publisher.set_queue_size(1)
    publisher.add_connection(ends[0])
    assert [type(each) for each in publisher.connections] == [DirectConnection]
    publisher.publish(String("word"))
    assert read(ends[1], 12) == b"\x08\0\0\0\x04\0\0\0word"
