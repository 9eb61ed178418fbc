"""Peers for the tests of services: TCPROS clients and servers on sockets of their own, services in ROS 2 that answer when they are told."""

import contextlib
import socket
import struct
import threading
from xmlrpc.client import ServerProxy

from ros_bridge_wire import exactly, header, read_header
from std_srvs.srv import SetBool
from uav_msgs.srv import SetSensor

from alula_testing.waits import HANGS_S, until
from ros_bridge.conversion import Types, ament_prefixes
from ros_bridge.deferred_service import DeferredService

BIG_BYTES = 4_000_000
SET_BOOL_SUM = "09fb03525b03e7ea1fd3992bafd87e16"
TYPES = Types(ament_prefixes())
SET_SENSOR = TYPES.service("uav_msgs/SetSensor")
SERVICES = """
services:
  - {name: /bv/in_ros2, server: ros2, type: uav_msgs/SetSensor, timeout_s: 20.0}
  - {name: /bv/held_in_ros2, server: ros2, type: std_srvs/SetBool, timeout_s: 20.0}
  - {name: /bv/in_ros1, server: ros1, type: uav_msgs/SetSensor, timeout_s: 20.0}
  - {name: /bv/odd_in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 2.0}
  - {name: /bv/held_in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 20.0}
"""


class Client:
    """A ROS 1 client on a socket of its own."""

    def __init__(self, world, service, **fields):
        code, _, uri = world.proxy.lookupService("/bv_client", service)
        assert code == 1
        host, _, port = uri.removeprefix("rosrpc://").rstrip("/").rpartition(":")
        self.socket = socket.create_connection((host, int(port)), HANGS_S)
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
    until(lambda: answers(world, "/bv/in_ros2", sensor_request("")), "the service answers")


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
        self.service = DeferredService(world.ros2.node, SetBool, name, self.take)
        until(lambda: answers(world, name, b"\0"), "the service answers")
        self.holds = True

    def take(self, request, asker):
        self.taken.append((request, asker)) if self.holds else self.service.reply(SetBool.Response(success=True), asker)


def echoed(words):
    return True, b"\1" + text(words)
