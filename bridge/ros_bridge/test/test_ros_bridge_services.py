"""Services among peers of every kind, by the data plane and through Python: raw TCPROS clients and servers on the ROS 1 side."""

import contextlib
import random
import signal
import socket
import struct
import threading
import time
from types import SimpleNamespace
from xmlrpc.client import ServerProxy

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from ros_bridge_harness import RUNNING, BridgeProcess, Master, wait_until
from ros_bridge_nodes import Ros2Peer
from ros_bridge_wire import exactly, header, read_header
from std_srvs.srv import Empty, SetBool
from uav_msgs.srv import SetSensor

from alula_common.network import free_port
from ros_bridge.conversion import Types, ament_prefixes
from ros_bridge.later import LaterService
from ros_bridge.services import refusal, refusal_around

CONFIG = """
services:
  - {name: /bv/in_ros2, server: ros2, type: uav_msgs/SetSensor, timeout_s: 20.0}
  - {name: /bv/held_in_ros2, server: ros2, type: std_srvs/SetBool, timeout_s: 20.0}
  - {name: /bv/in_ros1, server: ros1, type: uav_msgs/SetSensor, timeout_s: 20.0}
  - {name: /bv/odd_in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 2.0}
  - {name: /bv/held_in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 20.0}
"""
LIMIT_S = 20.0
BIG_BYTES = 4_000_000
SET_BOOL_SUM = "09fb03525b03e7ea1fd3992bafd87e16"
TYPES = Types(ament_prefixes())
SET_SENSOR = TYPES.service("uav_msgs/SetSensor")
PATHS = pytest.mark.parametrize("world", ["native", "python"], indirect=True)
NATIVE = pytest.mark.parametrize("world", ["native"], indirect=True)


@pytest.fixture(scope="module")
def world(request, ros2_domain, tmp_path_factory):
    """A master, a bridge that takes one of the paths, and a peer in ROS 2."""
    path = request.param
    master = Master(free_port())
    master.start()
    environment = dict(master.environment)
    if path == "python":
        environment["ROS_BRIDGE_NATIVE"] = "/no/such/library"
    bridge = BridgeProcess(SimpleNamespace(environment=environment), tmp_path_factory.mktemp(path), CONFIG)
    bridge.wait_running()
    ros2 = Ros2Peer()
    yield SimpleNamespace(master=master, bridge=bridge, ros2=ros2, proxy=ServerProxy(master.uri), path=path)
    ros2.tidy()
    ros2.close()
    bridge.close()
    master.close()
    RUNNING.clear()


@pytest.fixture(autouse=True)
def tidy(request):
    yield
    if "world" in request.fixturenames:
        request.getfixturevalue("world").ros2.tidy()


class Client:
    """A ROS 1 client on a socket of its own."""

    def __init__(self, world, service, **fields):
        code, _, uri = world.proxy.lookupService("/bv_client", service)
        assert code == 1
        host, _, port = uri.removeprefix("rosrpc://").rstrip("/").rpartition(":")
        self.socket = socket.create_connection((host, int(port)), LIMIT_S)
        self.socket.sendall(header(**{"callerid": "/bv_client", "service": service, "md5sum": "*", **fields}))
        self.answer = read_header(self.socket)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, body):
        self.socket.sendall(struct.pack("<I", len(body)) + body)

    def receive(self):
        good, length = struct.unpack("<BI", exactly(self.socket, 5))
        return bool(good), exactly(self.socket, length)

    def call(self, body):
        self.send(body)
        return self.receive()

    def ended(self):
        return self.socket.recv(1) == b""


class Server:
    """A ROS 1 service on a socket of its own; ``talk(connection)`` follows the client's header, on each connection in a thread."""

    def __init__(self, world, service, talk):
        self.name, self.talk, self.proxy = service, talk, ServerProxy(world.master.uri)
        self.connections = 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.uri = f"rosrpc://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()
        self.proxy.registerService("/bv_server", service, self.uri, "http://127.0.0.1:1/")

    def _accept(self):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self.listener.accept()
                self.connections += 1
                threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection):
        with contextlib.suppress(OSError, AssertionError), connection:
            self.header = read_header(connection)
            self.talk(connection)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.proxy.unregisterService("/bv_server", self.name, self.uri)
        self.listener.shutdown(socket.SHUT_RDWR)  # else it would take one more connection
        self.listener.close()


def greet(connection, md5sum="*"):
    connection.sendall(header(callerid="/bv_server", md5sum=md5sum, type="whatever"))


def request_from(connection):
    return exactly(connection, struct.unpack("<I", exactly(connection, 4))[0])


def answer(connection, body, *, good=True):
    connection.sendall(struct.pack("<BI", good, len(body)) + body)


def text(words):
    return struct.pack("<I", len(words)) + words.encode()


def sensor_request(sensor, mode=""):
    return text(sensor) + text(mode)


def echo(request, response):
    response.accepted, response.reason = True, request.sensor
    return response


def serve_echo(world):
    """Serve in ROS 2, and return when the bridge reaches the server."""
    server = world.ros2.node.create_service(SetSensor, "/bv/in_ros2", echo)
    world.ros2.ends.append((world.ros2.node.destroy_service, server))
    wait_until(lambda: answers(world, "/bv/in_ros2", sensor_request("")), "the service answers", LIMIT_S)


def answers(world, service, body):
    """Call once, not waiting long: a server that is new to its client drops responses until DDS has connected it both ways."""
    with Client(world, service) as client:
        client.socket.settimeout(1.0)
        try:
            return client.call(body)[0]
        except TimeoutError:
            return False


class HeldService:
    """A service in ROS 2 that answers at once until it is told to keep what comes."""

    def __init__(self, world, name):
        self.taken, self.holds = [], False
        self.service = LaterService(world.ros2.node, SetBool, name, self.take)
        wait_until(lambda: answers(world, name, b"\0"), "the service answers", LIMIT_S)
        self.holds = True

    def take(self, request, asker):
        self.taken.append((request, asker)) if self.holds else self.service.reply(SetBool.Response(success=True), asker)


def echoed(words):
    return True, b"\1" + text(words)


@PATHS
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


@NATIVE
def test_service_that_is_not_provided_is_refused(world):
    with Client(world, "/bv/in_ros2") as known:
        place = known.socket.getpeername()
    with socket.create_connection(place, LIMIT_S) as connection:
        connection.sendall(header(callerid="/t", service="/bv/nothing", md5sum="*"))
        assert "/bv/nothing" in read_header(connection)["error"]
        assert connection.recv(1) == b""


@PATHS
def test_persistent_connections_carry_one_call_after_the_other_also_sent_at_once(world):
    serve_echo(world)
    with Client(world, "/bv/in_ros2", persistent="1") as one, Client(world, "/bv/in_ros2", persistent="1") as other:
        for number in range(20):
            for client in (one, other):
                assert client.call(sensor_request(f"{number}")) == echoed(f"{number}")
        one.socket.sendall(b"".join(struct.pack("<I", len(body)) + body for body in map(sensor_request, "abcdef")))
        assert [one.receive() for _ in "abcdef"] == [echoed(letter) for letter in "abcdef"]


@PATHS
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
            response, _ = world.ros2.call("/bv/in_ros1", SetSensor, SetSensor.Request(sensor=sent), within_s=LIMIT_S)
            assert response.accepted
            assert response.reason == sent


@PATHS
def test_calls_that_are_held_hold_up_no_others(world):
    """Of three calls under way in ROS 2 one's client leaves: others are answered meanwhile, and the two that stay get their own answers."""
    held = HeldService(world, "/bv/held_in_ros2")
    serve_echo(world)
    clients = [Client(world, "/bv/held_in_ros2", persistent="1") for _ in range(3)]
    for number, client in enumerate(clients):
        client.send(b"\1" if number % 2 else b"\0")
        wait_until(lambda number=number: len(held.taken) == number + 1, "the request arrives in ROS 2", LIMIT_S)
    with Client(world, "/bv/in_ros2") as quick:
        assert quick.call(sensor_request("quick")) == echoed("quick")
    clients[0].socket.close()
    for request, asker in reversed(held.taken):
        held.service.reply(SetBool.Response(success=request.data, message="held"), asker)
    assert [client.receive() for client in clients[1:]] == [(True, b"\1" + text("held")), (True, b"\0" + text("held"))]
    for client in clients[1:]:
        client.socket.close()
    held.service.close()


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
@NATIVE
def test_odd_server_in_ros1_gives_a_refusal_with_the_reason_in_time(world, reason):
    with Server(world, "/bv/odd_in_ros1", ODD_SERVERS[reason]) as server:
        response, seconds = world.ros2.call("/bv/odd_in_ros1", SetBool, SetBool.Request(data=True), within_s=LIMIT_S)
        assert not response.success
        assert response.message.startswith("/bv/odd_in_ros1 by the bridge: ")
        assert reason in response.message
        assert seconds < LIMIT_S / 2
        assert server.header["service"] == "/bv/odd_in_ros1"
        assert server.header["md5sum"] == SET_BOOL_SUM


@NATIVE
def test_length_that_cannot_be_ends_the_call_and_no_more(world):
    with Server(world, "/bv/odd_in_ros1", say(struct.pack("<BI", 1, 0xFFFFFFFF), b"x" * 1000)):
        response, _ = world.ros2.call("/bv/odd_in_ros1", SetBool, SetBool.Request(data=True), within_s=LIMIT_S)
        assert not response.success
        assert "that can't be" in response.message


@PATHS
def test_request_is_sent_once_when_the_server_dies_in_the_call(world):
    requests = []

    def talk(connection):
        greet(connection)
        requests.append(request_from(connection))

    with Server(world, "/bv/odd_in_ros1", talk):
        response, _ = world.ros2.call("/bv/odd_in_ros1", SetBool, SetBool.Request(data=True), within_s=LIMIT_S)
        assert not response.success
        assert requests == [b"\1"]


@NATIVE
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
            response, _ = world.ros2.call("/bv/in_ros1", SetSensor, SetSensor.Request(), within_s=LIMIT_S)
            assert response.accepted
        assert server.connections == 1
        assert not ended.is_set()
        assert ended.wait(LIMIT_S)
        assert world.ros2.call("/bv/in_ros1", SetSensor, SetSensor.Request(), within_s=LIMIT_S)[0].accepted
        assert server.connections == 2


@NATIVE
def test_sixteen_calls_run_side_by_side_thirty_two_wait_and_more_are_refused(world):
    arrived, go = [], threading.Semaphore(0)

    def talk(connection):
        greet(connection)
        while True:
            arrived.append(request_from(connection))
            assert go.acquire(timeout=LIMIT_S)
            answer(connection, b"\1" + text("held"))

    client = world.ros2.node.create_client(SetBool, "/bv/held_in_ros1")
    with Server(world, "/bv/held_in_ros1", talk) as server:
        assert client.wait_for_service(LIMIT_S)
        futures = []
        for number in range(48):
            futures.append(client.call_async(SetBool.Request()))
            wait_until(lambda number=number: len(arrived) >= min(number + 1, 16), "16 calls arrive, one after the other", LIMIT_S)
        refused = client.call(SetBool.Request(), timeout_sec=LIMIT_S)
        assert not refused.success
        assert "48 calls of this service waiting" in refused.message
        assert (len(arrived), server.connections) == (16, 16)
        assert not any(future.done() for future in futures)
        for number in range(48):  # one by one, as a client in ROS 2 keeps ten responses that it has not taken
            go.release()
            wait_until(lambda number=number: sum(future.done() for future in futures) > number, "one more is answered", LIMIT_S)
        assert {future.result().message for future in futures} == {"held"}
        assert len(arrived) == 48
    world.ros2.node.destroy_client(client)


@NATIVE
def test_garbage_on_the_service_socket_harms_nobody(world):
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
            with contextlib.suppress(ConnectionError), socket.create_connection(place, LIMIT_S) as connection:
                connection.sendall(kinds[number % 4])
        assert bystander.call(sensor_request("still here")) == echoed("still here")
        good, reason = bystander.call(b"\xff\xff\xff\xff")
        assert not good
        assert b"the request is none of uav_msgs/SetSensor" in reason
        assert bystander.call(sensor_request("and after")) == echoed("and after")
    assert world.bridge.process.poll() is None


@NATIVE
def test_restarted_master_learns_where_services_are(world):
    serve_echo(world)
    with Client(world, "/bv/in_ros2", persistent="1") as old:
        before = world.proxy.lookupService("/t", "/bv/in_ros2")[2]
        world.master.close()
        assert old.call(sensor_request("no master")) == echoed("no master")
        world.master.start()
        wait_until(lambda: world.proxy.lookupService("/t", "/bv/in_ros2")[0] == 1, "the service is registered again", LIMIT_S)
        assert world.proxy.lookupService("/t", "/bv/in_ros2")[2] == before
    with Client(world, "/bv/in_ros2") as new:
        assert new.call(sensor_request("again")) == echoed("again")


@NATIVE
def test_end_of_the_bridge_answers_every_call_under_way_and_unregisters(world, tmp_path):
    names = {"/bv_end/in_ros1": "ros1", "/bv_end/in_ros2": "ros2"}
    lines = [f"  - {{name: {name}, server: {where}, type: std_srvs/SetBool, timeout_s: 30.0}}" for name, where in names.items()]
    bridge = BridgeProcess(world.master, tmp_path, "services:\n" + "\n".join(lines) + "\n", "__name:=ros_bridge_that_ends")
    bridge.wait_running()
    held = HeldService(world, "/bv_end/in_ros2")
    arrived = []

    def talk(connection):
        greet(connection)
        while True:
            arrived.append(request_from(connection))
            if len(arrived) == 1:
                answer(connection, b"\1" + text(""))

    in_ros1 = world.ros2.node.create_client(SetBool, "/bv_end/in_ros1")
    with Client(world, "/bv_end/in_ros2") as client, Server(world, "/bv_end/in_ros1", talk):
        assert in_ros1.wait_for_service(LIMIT_S)
        assert in_ros1.call(SetBool.Request(), timeout_sec=LIMIT_S).success
        future = in_ros1.call_async(SetBool.Request())
        client.send(b"\1")
        wait_until(lambda: len(arrived) == 2 and held.taken, "both calls arrive", LIMIT_S)
        start = time.monotonic()
        bridge.process.send_signal(signal.SIGINT)
        good, reason = client.receive()
        assert (good, b"the bridge is shutting down" in reason) == (False, True)
        wait_until(future.done, "the call from ROS 2 ends", LIMIT_S)
        assert "the bridge is shutting down" in future.result().message
        assert bridge.process.wait(LIMIT_S) == 0
        assert time.monotonic() - start < LIMIT_S / 2
    assert world.proxy.lookupService("/t", "/bv_end/in_ros2")[0] == -1
    world.ros2.node.destroy_client(in_ros1)
    held.service.close()


@given(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=300))
def test_refusal_of_the_data_plane_is_that_of_the_path_through_python(reason):
    for name, kind in (("uav_msgs/SetSensor", SetSensor), ("std_srvs/SetBool", SetBool)):
        convert = TYPES.service(name).response.to_ros1
        has_flag, has_text, before, after = refusal_around(kind.Response, convert)
        assert (has_flag, has_text) == (True, True)
        wanted = bytes(convert(serialize_message(refusal(kind.Response, reason))))
        assert before + struct.pack("<I", len(reason.encode())) + reason.encode() + after == wanted


def test_response_without_a_flag_has_no_refusal():
    assert refusal_around(Empty.Response, TYPES.service("std_srvs/Empty").response.to_ros1) == (False, False, b"", b"")
