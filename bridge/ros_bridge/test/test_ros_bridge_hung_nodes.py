"""Discovery beside nodes that hang: what others have is bridged as ever."""

import socket
import time
from contextlib import suppress
from itertools import pairwise
from xmlrpc.client import ServerProxy

import pytest
from ros_bridge_harness import PROBE_S, Ros1Peer
from std_msgs.msg import String

from alula_testing.waits import HANGS_S, until
from ros_bridge.hung_nodes import FIRST_PAUSE_S, LAST_PAUSE_S, HungNodes
from ros_bridge.service_types import ServiceTypes

CONFIG = ""
ARGUMENTS = ("--all",)
SERVICES = 200
"""So many that those which are asked side by side, and again after pauses, are few of them, also where a topic takes long to be bridged."""


@pytest.fixture
def hung(bridge, master):
    """Give a node that takes connections and never answers: its services and topics are registered, and are its own."""
    with socket.create_server(("127.0.0.1", 0), backlog=2 * SERVICES) as server:
        uri = f"127.0.0.1:{server.getsockname()[1]}"
        proxy = ServerProxy(master.uri)
        services = [f"/hung/service{number}" for number in range(SERVICES)] + ["/hung/get_loggers", "/hung/set_logger_level"]
        for name in services:
            proxy.registerService("/hung", name, f"rosrpc://{uri}", f"http://{uri}")
        proxy.registerPublisher("/hung", "/hung/strange", "strange_msgs/Strange", f"http://{uri}")
        yield server
        for name in services:
            proxy.unregisterService("/hung", name, f"rosrpc://{uri}")
        proxy.unregisterPublisher("/hung", "/hung/strange", f"http://{uri}")


def bridged(master, ros2_peer, name):
    """Return when a new node's topic has arrived in ROS 2."""
    received = ros2_peer.subscribe(name, String)
    peer = Ros1Peer(master)
    peer.do("advertise", topic=name, type="std_msgs/String")

    def arrives():
        peer.do("publish", topic=name, values={"data": "one"})
        return received

    until(arrives, f"{name} is bridged", HANGS_S, PROBE_S)


def times_asked(server):
    """Count the connections that have come to a node that hangs."""
    server.setblocking(False)
    number = 0
    with suppress(BlockingIOError):
        while True:
            server.accept()[0].close()
            number += 1
    return number


def test_topics_of_others_are_bridged_while_a_node_hangs(hung, master, ros2):
    """Each of its services takes a second to be given up: discovery that waited for them would ask all before the next topic."""
    for number in range(2):
        bridged(master, ros2, f"/hung/of_others{number}")
    assert 1 <= times_asked(hung) < SERVICES


def test_a_node_that_hangs_is_asked_again_after_growing_pauses():
    now_s = [0.0]
    nodes = HungNodes(lambda: now_s[0])
    asked = []
    while now_s[0] < 200.0:
        if nodes.may_be_asked("/hung"):
            asked.append(now_s[0])
            nodes.hangs("/hung")
        now_s[0] += 0.5
    pauses = [after - before for before, after in pairwise(asked)]
    assert pauses == [min(FIRST_PAUSE_S * 2**number, LAST_PAUSE_S) for number in range(len(pauses))]
    assert pauses[-1] == LAST_PAUSE_S
    nodes.answers("/hung")
    assert nodes.may_be_asked("/hung")


def test_services_of_a_node_that_hangs_are_given_up_together_and_others_answer():
    asked = []

    def ask(service):
        asked.append(service)
        if service.startswith("/hung"):
            raise TimeoutError
        return None if service == "/well/mute" else "std_srvs/SetBool"

    types = ServiceTypes(ask, HungNodes(time.monotonic))
    providers = {"/hung/a": "/hung", "/hung/b": "/hung", "/well/a": "/well", "/well/mute": "/well", "/well/z": "/well"}
    assert types.look(providers) == ({}, frozenset(providers))
    types.wait(HANGS_S)
    assert types.look(providers) == ({"/well/a": "std_srvs/SetBool", "/well/z": "std_srvs/SetBool"}, frozenset())
    assert [name for name in asked if name.startswith("/hung")] == ["/hung/a"]
    types.close()
