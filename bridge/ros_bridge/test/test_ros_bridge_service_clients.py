"""Services as clients in ROS 1 see them: handshake, persistent connections, large and held calls, garbage."""

import contextlib
import random
import socket
import struct

from ros_bridge_service_peers import (
    BIG_BYTES,
    SERVICES,
    SET_SENSOR,
    Client,
    HeldService,
    Server,
    answer,
    echoed,
    greet,
    request_from,
    sensor_request,
    serve_echo,
    text,
)
from ros_bridge_wire import header, read_header
from std_srvs.srv import SetBool
from uav_msgs.srv import SetSensor

from alula_testing.waits import HANGS_S, until

CONFIG = SERVICES


def test_clients_in_ros1_are_checked_and_answered(world):
    wrong_sum = Client(world, "/bv/in_ros2", md5sum="0" * 32)
    assert "md5sum" in wrong_sum.answer["error"]
    assert SET_SENSOR.md5sum in wrong_sum.answer["error"]
    assert wrong_sum.ended()
    no_sum = Client(world, "/bv/in_ros2", md5sum="")
    assert "error" in no_sum.answer
    assert no_sum.ended()
    serve_echo(world)
    for fields in ({}, {"md5sum": SET_SENSOR.md5sum}, {"type": "uav_msgs/SetSensor", "persistent": "0"}):
        with Client(world, "/bv/in_ros2", **fields) as client:
            assert (client.answer["type"], client.answer["md5sum"]) == ("uav_msgs/SetSensor", SET_SENSOR.md5sum)
            assert client.call(sensor_request("zed")) == echoed("zed")
            assert client.ended()  # a call a connection, unless it is to persist
    with Client(world, "/bv/in_ros2", probe="1") as client:
        assert client.answer["type"] == "uav_msgs/SetSensor"
        assert client.ended()


def test_service_that_is_not_provided_is_refused(world):
    with Client(world, "/bv/in_ros2") as known:
        place = known.socket.getpeername()
    with socket.create_connection(place, HANGS_S) as connection:
        connection.sendall(header(callerid="/t", service="/bv/nothing", md5sum="*"))
        assert "/bv/nothing" in read_header(connection)["error"]
        assert connection.recv(1) == b""


def test_persistent_connections_carry_one_call_after_the_other_also_sent_at_once(world):
    serve_echo(world)
    with Client(world, "/bv/in_ros2", persistent="1") as one, Client(world, "/bv/in_ros2", persistent="1") as other:
        for number in range(20):
            for client in (one, other):
                assert client.call(sensor_request(f"{number}")) == echoed(f"{number}")
        one.socket.sendall(b"".join(struct.pack("<I", len(body)) + body for body in map(sensor_request, "abcdef")))
        assert [one.receive() for _ in "abcdef"] == [echoed(letter) for letter in "abcdef"]


def test_big_requests_and_responses_cross_both_ways(world):
    serve_echo(world)
    words = "x" * BIG_BYTES
    with Client(world, "/bv/in_ros2", persistent="1") as client:
        for _ in range(2):
            assert client.call(sensor_request(words)) == echoed(words)
            assert client.call(sensor_request("small")) == echoed("small")

    def talk(connection):
        greet(connection)
        while True:
            answer(connection, b"\1" + request_from(connection)[:-4])  # the first string comes back

    with Server(world, "/bv/in_ros1", talk):
        for sent in (words, "small", words):
            response = world.ros2.call("/bv/in_ros1", SetSensor, SetSensor.Request(sensor=sent))
            assert response.accepted
            assert response.reason == sent


def test_calls_that_are_held_hold_up_no_others(world):
    """Of three calls under way in ROS 2 one's client leaves: others are answered meanwhile, and the two that stay get their own answers."""
    held = HeldService(world, "/bv/held_in_ros2")
    serve_echo(world)
    clients = [Client(world, "/bv/held_in_ros2", persistent="1") for _ in range(3)]
    for number, client in enumerate(clients):
        client.send(b"\1" if number % 2 else b"\0")
        until(lambda number=number: len(held.taken) == number + 1, "the request arrives in ROS 2")
    with Client(world, "/bv/in_ros2") as quick:
        assert quick.call(sensor_request("quick")) == echoed("quick")
    clients[0].socket.close()
    for request, asker in reversed(held.taken):
        held.service.reply(SetBool.Response(success=request.data, message="held"), asker)
    assert [client.receive() for client in clients[1:]] == [(True, b"\1" + text("held")), (True, b"\0" + text("held"))]
    for client in clients[1:]:
        client.socket.close()
    held.service.close()


def test_garbage_on_the_service_socket_harms_no_client(world):
    serve_echo(world)
    chance = random.Random(11)  # noqa: S311 - repeatable, not secret
    whole = header(callerid="/t", service="/bv/in_ros2", md5sum="*", persistent="1")
    request = struct.pack("<I", 8) + sensor_request("")
    with Client(world, "/bv/in_ros2", persistent="1") as bystander:
        place = bystander.socket.getpeername()
        for number in range(160):
            broken = bytearray(whole)
            for _ in range(chance.randrange(1, 4)):
                broken[chance.randrange(len(broken))] = chance.randrange(256)
            kinds = [
                bytes(broken) + request,
                whole + struct.pack("<I", 0xFFFFFFF0) + b"x" * 1000,
                whole + request[: chance.randrange(len(request))],
                whole + chance.randbytes(5000),
            ]
            with contextlib.suppress(ConnectionError), socket.create_connection(place, HANGS_S) as connection:
                connection.sendall(kinds[number % 4])
        assert bystander.call(sensor_request("still here")) == echoed("still here")
        good, reason = bystander.call(b"\xff\xff\xff\xff")
        assert not good
        assert b"the request is none of uav_msgs/SetSensor" in reason
        assert bystander.call(sensor_request("and after")) == echoed("and after")
    assert world.bridge.process.poll() is None
