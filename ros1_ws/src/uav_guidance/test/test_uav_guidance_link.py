"""The link over UDP and TCP, without ROS: what comes in, what goes out, what happens when the other side goes away."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from alula_testing.waits import until
from uav_guidance.encoding import heartbeat_message
from uav_guidance.link import Link

AUTOPILOT = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
STATION = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)


def frame(sender: mavlink.MAVLink, mode: int) -> bytes:
    return bytes(mavlink.MAVLink_heartbeat_message(13, 3, 81, mode, 4, 3).pack(sender))


class Ear:
    """A link that is started; ``take`` is called with each mode that is heard."""

    def __init__(self, url: str, take: Callable[[int], None] = lambda _mode: None) -> None:
        self.modes: list[int] = []
        self.connected, self.idle = threading.Semaphore(0), threading.Semaphore(0)
        self._take = take
        self.link = Link(url, 57600, on_message=self._hear, on_connect=self.connected.release, on_idle=self.idle.release)
        self.link.start()

    def _hear(self, message: mavlink.MAVLink_heartbeat_message) -> None:
        self.modes.append(message.custom_mode)
        self._take(message.custom_mode)


def reached(ear: Ear, peer: socket.socket) -> object:
    """Return the link's address, once it has sent something to the peer."""
    assert ear.connected.acquire(timeout=5.0)
    ear.link.send(heartbeat_message())
    return peer.recvfrom(300)[1]


@pytest.fixture
def peer() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(5.0)
        yield peer


def test_udp_of_a_vehicle_that_sends_to_us(peer):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    ear = Ear(f"udpin:127.0.0.1:{port}")
    assert ear.connected.acquire(timeout=5.0)
    peer.sendto(frame(STATION, 1) + b"\x00noise" + frame(AUTOPILOT, 4), ("127.0.0.1", port))
    until(lambda: ear.modes == [4], what="the autopilot's heartbeat only")
    ear.link.send(heartbeat_message())
    heard = mavlink.MAVLink(None).parse_buffer(peer.recv(300))[0]
    assert (heard.get_srcSystem(), heard.get_srcComponent(), heard.type) == (1, 191, mavlink.MAV_TYPE_ONBOARD_CONTROLLER)
    ear.link.close()


def test_udp_towards_a_vehicle(peer):
    ear = Ear(f"udpout:127.0.0.1:{peer.getsockname()[1]}")
    peer.sendto(frame(AUTOPILOT, 9), reached(ear, peer))
    until(lambda: ear.modes == [9], what="the answer")
    ear.link.close()


def test_tcp_that_is_not_there_yet_and_goes_away():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        ear = Ear(f"tcp:127.0.0.1:{listener.getsockname()[1]}")
        ear.link.send(heartbeat_message())  # lost: no peer is there
        assert not ear.connected.acquire(timeout=0.3)
        listener.listen()
        for mode in (4, 5):
            assert ear.connected.acquire(timeout=5.0)
            client, _ = listener.accept()
            with client:
                half = len(frame(AUTOPILOT, mode)) // 2
                data = frame(AUTOPILOT, mode)
                client.sendall(data[:half])
                client.sendall(data[half:])
                until(lambda mode=mode: ear.modes[-1:] == [mode], what="a heartbeat")
    assert ear.modes == [4, 5]
    ear.link.close()


def test_a_connection_that_ends_leaves_the_link_idle_and_says_so():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        ear = Ear(f"tcp:127.0.0.1:{listener.getsockname()[1]}")
        assert ear.connected.acquire(timeout=5.0)
        client, _ = listener.accept()
        assert not ear.idle.acquire(timeout=0.1), "nothing has arrived"
        client.close()
        assert ear.idle.acquire(timeout=5.0)
        assert ear.link.idle
        ear.link.close()


def test_a_message_that_can_not_be_dealt_with_does_not_end_the_link(peer):
    ear = Ear(f"udpout:127.0.0.1:{peer.getsockname()[1]}", take=lambda mode: 1 // (mode - 1))
    address = reached(ear, peer)
    # What was cut short takes its missing bytes from the one behind it; both are lost.
    for data in (frame(AUTOPILOT, 1), frame(AUTOPILOT, 2)[:-4], frame(AUTOPILOT, 3), frame(AUTOPILOT, 4)):
        peer.sendto(data, address)
    until(lambda: ear.modes == [1, 4], what="a message behind those that raised and that were cut short")
    assert ear.idle.acquire(timeout=5.0)
    ear.link.close()


def test_the_link_is_idle_when_all_that_has_arrived_has_been_handed_over(peer):
    taken, go_on = threading.Semaphore(0), threading.Semaphore(0)

    def take(_mode: int) -> None:
        taken.release()
        assert go_on.acquire(timeout=5.0)

    ear = Ear(f"udpout:127.0.0.1:{peer.getsockname()[1]}", take)
    address = reached(ear, peer)
    assert ear.link.idle, "nothing has arrived"
    peer.sendto(frame(AUTOPILOT, 1), address)
    peer.sendto(frame(AUTOPILOT, 2), address)
    assert taken.acquire(timeout=5.0)
    assert not ear.link.idle, "the first message is being handled, the second one waits"
    go_on.release()
    assert taken.acquire(timeout=5.0)
    assert not ear.link.idle
    assert not ear.idle.acquire(blocking=False), "the second message came before the link was idle"
    go_on.release()
    assert ear.idle.acquire(timeout=5.0)
    assert ear.link.idle
    ear.link.close()
