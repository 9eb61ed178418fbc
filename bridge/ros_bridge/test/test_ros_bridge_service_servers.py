"""Services whose server in ROS 1 is odd, dies, is slow or moves: what clients in ROS 2 get, and when."""

import contextlib
import struct
import threading

import pytest
from ros_bridge_service_peers import (
    SERVICES,
    SET_BOOL_SUM,
    Server,
    answer,
    greet,
    request_from,
    text,
)
from ros_bridge_wire import header
from std_srvs.srv import SetBool
from uav_msgs.srv import SetSensor

from alula_testing.waits import HANGS_S, until

CONFIG = SERVICES


def hang_up(connection):
    connection.close()


def say(*parts):
    def talk(connection):
        greet(connection)
        request_from(connection)
        connection.sendall(b"".join(parts))

    return talk


ODD_SERVERS = {
    "no connection to the server": hang_up,
    "what it sent is no": lambda connection: connection.sendall(struct.pack("<I", 9) + struct.pack("<I", 4000) + b"hello"),
    "the server refuses the connection: not you": lambda connection: connection.sendall(header(error="not you")),
    "the server ended in the call": say(),
    "ended in the call": say(b"\1\x10\0\0\0half"),
    "broken on purpose": say(struct.pack("<BI", 0, 17) + b"broken on purpose"),
    "answer": say(struct.pack("<BI", 1, 3) + b"\1\2\3"),
    "timed out": lambda connection: (greet(connection), request_from(connection), connection.recv(1)),
}


@pytest.mark.parametrize("reason", ODD_SERVERS)
def test_odd_server_in_ros1_gives_a_refusal_with_the_reason(world, reason):
    with Server(world, "/bv/odd_in_ros1", ODD_SERVERS[reason]) as server:
        response = world.ros2.call("/bv/odd_in_ros1", SetBool, SetBool.Request(data=True))
        assert not response.success
        assert response.message.startswith("/bv/odd_in_ros1 by the bridge: ")
        assert reason in response.message
        assert server.header["service"] == "/bv/odd_in_ros1"
        assert server.header["md5sum"] == SET_BOOL_SUM


def test_length_that_cannot_be_ends_the_call_and_no_more(world):
    with Server(world, "/bv/odd_in_ros1", say(struct.pack("<BI", 1, 0xFFFFFFFF), b"x" * 1000)):
        response = world.ros2.call("/bv/odd_in_ros1", SetBool, SetBool.Request(data=True))
        assert not response.success
        assert "that can't be" in response.message


def test_request_is_sent_once_when_the_server_dies_in_the_call(world):
    requests = []

    def talk(connection):
        greet(connection)
        requests.append(request_from(connection))

    with Server(world, "/bv/odd_in_ros1", talk):
        response = world.ros2.call("/bv/odd_in_ros1", SetBool, SetBool.Request(data=True))
        assert not response.success
        assert requests == [b"\1"]


def test_connection_is_kept_for_the_next_call_and_dropped_when_none_comes(world):
    ended = threading.Event()

    def talk(connection):
        greet(connection)
        with contextlib.suppress(AssertionError):
            while request_from(connection):
                answer(connection, b"\1" + text(""))
        ended.set()

    with Server(world, "/bv/in_ros1", talk) as server:
        for _ in range(5):
            response = world.ros2.call("/bv/in_ros1", SetSensor, SetSensor.Request())
            assert response.accepted
        assert server.connections == 1
        assert not ended.is_set()
        assert ended.wait(HANGS_S)
        assert world.ros2.call("/bv/in_ros1", SetSensor, SetSensor.Request()).accepted
        assert server.connections == 2


def test_sixteen_calls_run_side_by_side_thirty_two_wait_and_more_are_refused(world):
    arrived, go = [], threading.Semaphore(0)

    def talk(connection):
        greet(connection)
        while True:
            arrived.append(request_from(connection))
            assert go.acquire(timeout=HANGS_S)
            answer(connection, b"\1" + text("held"))

    client = world.ros2.node.create_client(SetBool, "/bv/held_in_ros1")
    with Server(world, "/bv/held_in_ros1", talk) as server:
        assert client.wait_for_service(HANGS_S)
        futures = []
        for number in range(48):
            futures.append(client.call_async(SetBool.Request()))
            until(lambda number=number: len(arrived) >= min(number + 1, 16), "16 calls arrive, one after the other")
        refused = client.call(SetBool.Request(), timeout_sec=HANGS_S)
        assert not refused.success
        assert "48 calls of this service waiting" in refused.message
        assert (len(arrived), server.connections) == (16, 16)
        assert not any(future.done() for future in futures)
        for number in range(48):  # one by one, as a client in ROS 2 keeps ten responses that it has not taken
            go.release()
            until(lambda number=number: sum(future.done() for future in futures) > number, "one more is answered")
        assert {future.result().message for future in futures} == {"held"}
        assert len(arrived) == 48
    world.ros2.node.destroy_client(client)
