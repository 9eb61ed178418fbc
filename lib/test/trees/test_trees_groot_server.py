"""The server of Groot2's protocol: every request, wrong ones, and viewers that come, go and don't read."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading

import pytest

pytest.importorskip("msgpack")
pytest.importorskip("zmq")

import msgpack
import zmq
from trees_viewer import Viewer

from alula.trees.groot.address import Address, ServerError
from alula.trees.groot.protocol import Request, Status
from alula.trees.groot.server import NO_HOOKS, Server
from alula.trees.groot.states import KEPT_TRANSITIONS, NodeStates, Shown

IDLE, RUNNING, SUCCESS = b"\x00", b"\x01", b"\x02"


class Rig:
    """A server of a made-up tree of two nodes, 1 and 258."""

    def __init__(self) -> None:
        self.now_us = 7_000_000
        self.values = {"x": 1, "height": 2.5, "third": 1 / 3, "far": 1e300, "names": ["a", None, True]}
        self.values |= {"at": {"z": 1, "y": 2}, "big": 1 << 70}
        self.states = NodeStates([1, 258], lambda: self.now_us)
        self.shown = Shown("<root/>", self.states, {"Main": lambda: self.values, "Sub::4": dict})
        self.server = Server(self.shown, Address(port=0))

    def change(self, uid: int, previous: Status, status: Status) -> None:
        self.states.take([(uid, previous, status)], self.now_us)


@pytest.fixture
def rig():
    rig = Rig()
    yield rig
    rig.server.close()


@pytest.fixture
def viewer(rig):
    viewer = Viewer(rig.server.address)
    yield viewer
    viewer.socket.close()


def test_a_reply_begins_with_the_request_and_the_trees_own_number(rig, viewer):
    head, xml = viewer.ask("T")
    assert head[:6] == struct.pack("<BBI", 2, ord("T"), 77)
    assert len(head) == 22
    assert xml == b"<root/>"
    assert viewer.ask("S")[0][6:] == head[6:]
    other = Rig()
    assert Viewer(other.server.address).ask("T")[0][6:] != head[6:]
    other.server.close()


def test_a_status_is_the_last_one_plus_ten_once_a_node_is_idle(rig, viewer):
    assert viewer.ask("S")[1] == b"\x01\x00" + IDLE + b"\x02\x01" + IDLE
    rig.change(1, Status.IDLE, Status.RUNNING)
    rig.change(258, Status.RUNNING, Status.SUCCESS)
    assert viewer.ask("S")[1] == b"\x01\x00" + RUNNING + b"\x02\x01" + SUCCESS
    rig.change(258, Status.SUCCESS, Status.IDLE)
    assert viewer.ask("S")[1][-1] == 12


def test_blackboards_come_by_the_names_of_subtrees(viewer):
    # Keys in order; a number as short as it can be without a loss.
    plain = {"at": {"y": 2, "z": 1}, "big": str(1 << 70), "far": 1e300, "height": 2.5, "names": ["a", None, True], "third": 1 / 3, "x": 1}
    packed = viewer.ask("B", b"Main;nowhere;Sub::4")[1]
    assert msgpack.unpackb(packed) == {"Main": plain, "Sub::4": None}
    assert list(msgpack.unpackb(packed)["Main"]) == sorted(plain)
    assert b"\xa6height\xca\x40\x20\x00\x00" in packed
    assert viewer.ask("B", b"nowhere")[1] == b"\xc0"


def test_a_value_that_can_not_be_read_is_told_to_its_viewer(rig, viewer):
    rig.values = {"text": "\ud800"}
    refusal, sentence = viewer.ask("B", b"Main")
    assert refusal == b"error"
    assert sentence.startswith(b"UnicodeEncodeError: ")
    assert viewer.ask("T")[1] == b"<root/>"


def test_transitions_are_recorded_from_start_to_stop_in_mission_time(rig, viewer):
    rig.change(1, Status.IDLE, Status.RUNNING)
    assert viewer.ask("r", b"start")[1] == b"7000000"
    rig.now_us += (1 << 33) + 5
    rig.change(1, Status.RUNNING, Status.IDLE)
    viewer.ask("r", b"stop")
    rig.change(1, Status.IDLE, Status.RUNNING)
    # microseconds (6 bytes), uid, status
    assert viewer.ask("t")[1] == b"\x05\x00\x00\x00\x02\x00" + b"\x01\x00" + IDLE
    assert viewer.ask("t")[1] == b""


def test_a_recording_that_nobody_fetches_keeps_the_newest(rig, viewer):
    viewer.ask("r", b"start")
    for n in range(KEPT_TRANSITIONS + 3):
        rig.now_us = 7_000_000 + n
        rig.change(1, Status.IDLE, Status.RUNNING)
    kept = viewer.ask("t")[1]
    assert len(kept) == 9 * KEPT_TRANSITIONS
    assert kept[0] == 3


def test_hooks_are_refused_and_there_are_none(viewer):
    assert viewer.ask("I", b'{"uid": 1, "position": 0, "mode": 0}') == [b"error", NO_HOOKS.encode()]
    assert viewer.ask("D")[1] == b"[]"
    for request in "RU":
        assert viewer.ask(request, b'{"uid": 1, "position": 0}') == [b"error", b"Node ID not found"]
    for request in "AX":
        assert len(viewer.ask(request)) == 1


@pytest.mark.parametrize("header", [b"", b"12345", b"1234567", struct.pack("<BBI", 2, ord("T"), 1) * 2])
def test_a_wrong_header_is_refused(viewer, header):
    assert viewer.raw(header) == [b"error", b"wrong request header"]


def test_what_the_protocol_does_not_know_is_refused(viewer):
    known = {request.value for request in Request}
    for number in set(range(256)) - known:
        assert viewer.raw(struct.pack("<BBI", 2, number, 1)) == [b"error", b"Request not recognized"]
    for request in "BrIRU":
        assert viewer.ask(request) == viewer.ask(request, b"", b"") == [b"error", b"must be 2 parts message"]
    assert viewer.ask("B", b"\xff\xfe")[1] == b"\xc0"


def test_viewers_come_and_go(rig):
    for _ in range(30):
        viewer = Viewer(rig.server.address)
        viewer.socket.send(struct.pack("<BBI", 2, ord("T"), 1))
        viewer.socket.close()
    with contextlib.closing(socket.create_connection((rig.server.address.host, rig.server.address.port))) as raw:
        raw.sendall(b"GET / HTTP/1.1\r\n\r\n" * 100)
    viewers = [Viewer(rig.server.address) for _ in range(5)]
    for viewer in viewers * 3:
        assert viewer.ask("T")[1] == b"<root/>"
    for viewer in viewers:
        viewer.socket.close()


def test_a_viewer_that_never_reads_holds_up_nobody(rig, viewer):
    silent = zmq.Context.instance().socket(zmq.DEALER)
    silent.setsockopt(zmq.LINGER, 0)
    silent.setsockopt(zmq.RCVHWM, 1)
    silent.setsockopt(zmq.SNDTIMEO, 100)
    silent.connect(f"tcp://{rig.server.address.host}:{rig.server.address.port}")
    listener = zmq.Context.instance().socket(zmq.SUB)
    listener.connect(f"tcp://{rig.server.address.host}:{rig.server.address.port + 1}")
    listener.subscribe(b"")
    with contextlib.suppress(zmq.Again):
        for number in range(5000):
            silent.send_multipart([b"", struct.pack("<BBI", 2, ord("T"), number)])
            if number % 500 == 0:
                assert viewer.ask("T")[1] == b"<root/>"
    assert viewer.ask("T")[1] == b"<root/>"
    silent.close()
    listener.close(linger=0)


def test_a_message_that_is_too_long_ends_its_viewer_alone(rig, viewer):
    loud = Viewer(rig.server.address)
    loud.socket.send_multipart([struct.pack("<BBI", 2, ord("B"), 1), bytes(1 << 20)])
    assert viewer.ask("T")[1] == b"<root/>"
    assert not loud.socket.poll(200)
    loud.socket.close()


def test_ports_that_are_taken_are_named(rig):
    address = rig.server.address
    with pytest.raises(
        ServerError, match=rf"on 127.0.0.1, ports {address.port} and {address.port + 1}: Address already in use; choose others"
    ):
        Server(rig.shown, address)


def test_it_listens_on_loopback_unless_told_otherwise():
    assert Address.read("") == Address("127.0.0.1", 1667)
    assert Address.read("1700") == Address("127.0.0.1", 1700)
    assert Address.read("0.0.0.0:1700") == Address("0.0.0.0", 1700)  # noqa: S104
    for text in ("x", "1:", "65535", "-1", "²"):
        with pytest.raises(ServerError, match=r"is no \[HOST:\]PORT"):
            Address.read(text)


def test_another_tree_is_served_by_another_number(rig, viewer):
    before = viewer.ask("T")[0][6:]
    rig.server.show(Shown("<other/>", NodeStates([7], lambda: 0), {}))
    head, xml = viewer.ask("T")
    assert xml == b"<other/>"
    assert head[6:] != before
    statuses = viewer.ask("S")
    assert statuses == [statuses[0][:6] + head[6:], b"\x07\x00" + IDLE]


def test_a_server_that_is_closed_leaves_nothing(rig):
    rig.server.close()
    rig.server.close()
    assert "groot" not in {thread.name for thread in threading.enumerate()}
    again = Server(rig.shown, rig.server.address)
    again.close()
