"""A call that was given up never comes later: not where its connection stands at last, and not of what waited to be sent again."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

rospy = pytest.importorskip("rospy")

import rosgraph  # noqa: E402
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse  # noqa: E402

from alula_testing.waits import HANGS_S  # noqa: E402
from resource_reporter import CallFailedError, ServiceCaller  # noqa: E402

NAME = "/late"
LIMIT_S = 0.2


def field(text: str) -> bytes:
    """Return a field of a connection header: its length, little endian, and its text."""
    return struct.pack("<I", len(text)) + text.encode()


def read(peer: socket.socket, count: int) -> bytes:
    """Read so many bytes, or fewer where the connection ends."""
    taken = b""
    while len(taken) < count and (part := peer.recv(count - len(taken))):
        taken += part
    return taken


def take_header(peer: socket.socket) -> None:
    """Read the caller's connection header, and answer it as a service does."""
    read(peer, struct.unpack("<I", read(peer, 4))[0])
    fields = b"".join(
        map(field, ("callerid=/late", f"md5sum={Trigger._md5sum}", "type=std_srvs/Trigger", "request_type=", "response_type="))
    )
    peer.sendall(struct.pack("<I", len(fields)) + fields)


@pytest.fixture
def late(ros_master: str) -> Iterator[socket.socket]:
    """A service of which the master knows, and which answers when the test does."""
    master = rosgraph.Master(NAME)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(HANGS_S)
        uri = f"rosrpc://127.0.0.1:{server.getsockname()[1]}"
        master.registerService(NAME, uri, "http://127.0.0.1:1/")
        yield server
        master.unregisterService(NAME, uri)


def serve(server: socket.socket) -> tuple[bytes, bool]:
    """Answer the header of the next connection, and nothing more; return what else it brings, and whether it is reset."""
    taken = b""
    with server.accept()[0] as peer:
        peer.settimeout(HANGS_S)
        try:
            take_header(peer)
            while part := peer.recv(100):
                taken += part
        except ConnectionError:
            return taken, True
    return taken, False


def take_request(server: socket.socket) -> bytes:
    """Take the next request of an empty type, and end its connection."""
    with server.accept()[0] as peer:
        peer.settimeout(HANGS_S)
        take_header(peer)
        return read(peer, 4)


def test_what_was_given_up_before_it_was_connected_is_not_asked_for_afterwards(late):
    caller = ServiceCaller(NAME, Trigger)
    with pytest.raises(CallFailedError, match=f"did not answer within {LIMIT_S:g} s"):
        caller.call(TriggerRequest(), limit_s=LIMIT_S)
    assert serve(late)[0] == b""


def test_what_was_sent_and_given_up_is_dropped_with_its_connection(late):
    caller = ServiceCaller(NAME, Trigger)
    with ThreadPoolExecutor() as others:
        served = others.submit(serve, late)
        with pytest.raises(CallFailedError, match="did not answer"):
            caller.call(TriggerRequest(), limit_s=LIMIT_S)
        assert served.result()[1], "a connection that ends in order sends again what was not acknowledged"


def test_a_connection_that_does_not_come_about_is_begun_anew(ros_master):
    master = rosgraph.Master(NAME)
    with socket.create_server(("127.0.0.1", 0), backlog=0) as server, ThreadPoolExecutor() as others:
        server.settimeout(HANGS_S)
        place = server.getsockname()
        uri = f"rosrpc://127.0.0.1:{place[1]}"
        master.registerService(NAME, uri, "http://127.0.0.1:1/")
        caller = ServiceCaller(NAME, Trigger)
        with socket.create_connection(place):  # nobody else can connect
            with pytest.raises(CallFailedError, match="unable to connect to service"):
                caller.call(TriggerRequest(), limit_s=HANGS_S)
            server.accept()[0].close()
        asked = others.submit(take_request, server)
        with pytest.raises(CallFailedError, match=r"unable to receive data|no response"):
            caller.call(TriggerRequest(), limit_s=HANGS_S)
        assert asked.result() == bytes(4), "its length: it is empty"
        master.unregisterService(NAME, uri)


def test_the_next_call_has_a_connection_of_its_own(late):
    caller = ServiceCaller(NAME, Trigger)
    with pytest.raises(CallFailedError):
        caller.call(TriggerRequest(), limit_s=LIMIT_S)
    service = rospy.Service(NAME, Trigger, lambda _: TriggerResponse(True, "here"))
    assert caller.call(TriggerRequest()).message == "here"
    assert serve(late)[0] == b""
    assert caller.call(TriggerRequest()).message == "here", "what was given up changes nothing of it"
    caller.close()
    service.shutdown("end")
