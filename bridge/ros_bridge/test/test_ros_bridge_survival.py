"""What the bridge goes on through: a master that goes and comes, a link that is cut, peers that are killed in a message, garbage."""

import contextlib
import json
import socket
import struct
import threading
from types import SimpleNamespace

import pytest
from ros_bridge_harness import PROBE_S, BridgeProcess, Master, Ros1Peer
from ros_bridge_nodes import LATCHED, Ros2Peer, open_up, wait_ros1_receives
from sensor_msgs.msg import Image
from std_msgs.msg import String
from std_srvs.srv import SetBool

from alula.common.network import free_port
from alula_testing.waits import HANGS_S, until
from bridge_tools.fuzz import Fuzzer
from bridge_tools.hostile import LENGTH, HostilePublisher
from ros_bridge.tcpros import encode_header

CONFIG = """
topics:
  - {name: /bs/up, direction: ros1_to_ros2, type: std_msgs/String, depth: 1000}
  - {name: /bs/fuzzed, direction: ros1_to_ros2, type: std_msgs/String, depth: 10}
  - {name: /bs/down, direction: ros2_to_ros1, type: std_msgs/String, depth: 1000}
  - {name: /bs/image, direction: ros1_to_ros2, type: sensor_msgs/Image, depth: 5}
services:
  - {name: /bs/in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 15.0}
  - {name: /bs/held, server: ros1, type: std_srvs/SetBool, timeout_s: 60.0}
  - {name: /bs/quick, server: ros1, type: std_srvs/SetBool, timeout_s: 60.0}
  - {name: /bs/in_ros2, server: ros2, type: std_srvs/SetBool, timeout_s: 15.0}
"""
IMAGE = {"type": "sensor_msgs/Image", "md5sum": "060021388200f6f0f447d0fcd9c64743", "message_definition": "", "callerid": "/half"}
IMAGE_BYTES = 4_000_000
BEAT_S = 0.2


class Link:
    """A link to a TCP server that can be cut (connections end, none comes about) and made to hang (nothing passes any more)."""

    def __init__(self, port: int) -> None:
        self._target = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self.cut = False
        self.flows = threading.Event()
        self.flows.set()
        self._open: set[socket.socket] = set()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                if self.cut:
                    near.close()
                    continue
                with contextlib.suppress(OSError):
                    far = socket.create_connection(("127.0.0.1", self._target))
                    self._open |= {near, far}
                    for source, target in ((near, far), (far, near)):
                        threading.Thread(target=self._pump, args=(source, target), daemon=True).start()

    def _pump(self, source: socket.socket, target: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                self.flows.wait()
                target.sendall(data)
        self._end(source, target)

    def _end(self, *connections: socket.socket) -> None:
        for connection in connections:
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            connection.close()
            self._open.discard(connection)

    def break_off(self) -> None:
        self.cut = True
        self._end(*tuple(self._open))

    def close(self) -> None:
        self.flows.set()
        self._listener.close()
        self.break_off()


@pytest.fixture(scope="module")
def world(ros2_domain, tmp_path_factory):
    """A master, a link to it, a bridge that has only the link, and a peer on either side."""
    master = Master(free_port())
    master.start()
    link = Link(master.port)
    linked = SimpleNamespace(environment={**master.environment, "ROS_MASTER_URI": f"http://127.0.0.1:{link.port}"})
    bridge = BridgeProcess(linked, tmp_path_factory.mktemp("survival"), CONFIG)
    bridge.wait_running()
    ros2 = Ros2Peer()
    yield SimpleNamespace(master=master, link=link, bridge=bridge, ros2=ros2)
    ros2.tidy()
    ros2.close()
    bridge.close()
    link.close()
    master.close()


@pytest.fixture(autouse=True)
def bridge_survives(world):
    yield
    world.ros2.tidy()
    assert world.bridge.process.poll() is None


def steady(world, peer):
    """Open the route to ROS 2 from a peer; return what arrives and a check that 20 more messages all do."""
    received = open_up(peer, world.ros2, "/bs/up", String, "std_msgs/String")

    def check(word: str) -> None:
        for number in range(20):
            peer.do("publish", topic="/bs/up", values={"data": f"{word} {number}"})
        until(lambda: received and received[-1].data == f"{word} 19", f"the last of '{word}' arrives")
        assert [message.data for message in received if message.data.startswith(word)] == [f"{word} {number}" for number in range(20)]

    return check


def hear_master(world):
    """Return a function that tells what the last heartbeat says of the master."""
    beats = world.ros2.subscribe("/ros_bridge/state", String, LATCHED)
    until(lambda: beats, "a heartbeat")
    return lambda: json.loads(beats[-1].data)["ros1_master"]


@pytest.mark.parametrize("how", ["cut", "hang"])
def test_link_to_the_master_goes_and_comes_back(world, how):
    peer = Ros1Peer(world.master)
    check = steady(world, peer)
    master_there = hear_master(world)
    said = len(world.bridge.lines)
    assert master_there()
    if how == "cut":
        world.link.break_off()
    else:
        world.link.flows.clear()
    until(lambda: not master_there(), "the heartbeat says that the master is gone")
    check(f"without {how}")
    world.link.cut = False
    world.link.flows.set()
    until(master_there, "the heartbeat says that the master is back")
    check(f"again {how}")
    late = Ros1Peer(world.master)
    late.do("advertise", topic="/bs/up", type="std_msgs/String")
    late_received = world.ros2.subscribe("/bs/up", String)

    def arrives():
        late.do("publish", topic="/bs/up", values={"data": "late"})
        return any(message.data == "late" for message in late_received)

    until(arrives, "a publisher that came later is bridged", every_s=PROBE_S)
    complaints = [line for line in world.bridge.lines[said:] if "does not answer" in line]
    assert len(complaints) == 1


def test_restarted_master_learns_everything_again_while_old_connections_go_on(world):
    old = Ros1Peer(world.master)
    check = steady(world, old)
    world.master.close()
    check("no master")
    world.master.start()
    until(lambda: any("registering everything again" in line for line in world.bridge.lines), "the bridge registers again")
    new = Ros1Peer(world.master)
    new.do("subscribe", topic="/bs/down", type="std_msgs/String")
    wait_ros1_receives(new, world.ros2.publisher("/bs/down", String, 200), "/bs/down")
    new.do("serve", service="/bs/in_ros1", type="std_srvs/SetBool", behaviour="echo")
    response = world.ros2.call("/bs/in_ros1", SetBool, SetBool.Request(data=True))
    assert response.success
    check("old connection")


def test_publisher_killed_in_the_middle_of_a_4_mb_message(world):
    """Half a message leaves nothing behind: the next publisher's whole one arrives, and only that."""
    images: list[Image] = []
    arrived = threading.Event()
    world.ros2.listen("/bs/image", Image, lambda image: (images.append(image), arrived.set()))
    data = bytes(IMAGE_BYTES)
    message = (
        bytes(16) + struct.pack("<II", 1000, 1000) + LENGTH.pack(5) + b"rgba8" + struct.pack("<BI", 0, 4000) + LENGTH.pack(len(data)) + data
    )
    whole = LENGTH.pack(len(message)) + message

    def half(connection: socket.socket) -> None:
        connection.sendall(whole[: len(whole) // 2])

    def all_of_it(connection: socket.socket) -> None:
        while not images:  # a reader in ROS 2 that has found the bridge may still be unknown to it
            connection.sendall(whole)
            arrived.wait(4 * PROBE_S)

    for name, talk in (("/half", half), ("/whole", all_of_it)):
        publisher = HostilePublisher(world.master.uri, "/bs/image", "sensor_msgs/Image", name=name, reply=encode_header(IMAGE), talk=talk)
        assert publisher.served.wait(15.0)
        publisher.close()
    until(lambda: images, "the whole image arrives")
    assert {(image.width, image.encoding, len(image.data)) for image in images} == {(1000, "rgba8", IMAGE_BYTES)}


def test_subscriber_killed_in_the_middle_of_4_mb_messages(world):
    alive, mortal = Ros1Peer(world.master), Ros1Peer(world.master)
    publisher = world.ros2.publisher("/bs/down", String, 200)
    for peer in (alive, mortal):
        peer.do("subscribe", topic="/bs/down", type="std_msgs/String")
        wait_ros1_receives(peer, publisher, "/bs/down")
    big = String(data="x" * IMAGE_BYTES)
    publisher.publish(big)
    publisher.publish(big)
    mortal.process.kill()
    publisher.publish(String(data="after"))
    alive.expect("message", topic="/bs/down", hex=(struct.pack("<I", 5) + b"after").hex())


def test_garbage_on_all_sockets_leaves_the_bridge_alive_and_its_memory_flat(world):
    peer = Ros1Peer(world.master)
    check = steady(world, peer)
    answered = []
    served = world.ros2.node.create_service(SetBool, "/bs/in_ros2", lambda request, reply: answered.append(request.data) or reply)
    figures = Fuzzer(world.master.uri, "/bs/fuzzed", "/bs/down", seed=7, service="/bs/in_ros2").run(6.0)
    world.ros2.node.destroy_service(served)
    assert figures.alive
    assert figures.thrown > 10
    assert answered  # some of it was what a client says
    assert figures.grown_mb < 30.0
    check("after the garbage")


def test_slow_calls_run_side_by_side_and_hold_up_no_other_service(world):
    """Ten calls begin before any of them ends, and meanwhile a call of another service is answered."""
    server = Ros1Peer(world.master)
    server.do("serve", service="/bs/held", type="std_srvs/SetBool", behaviour="held")
    server.do("serve", service="/bs/quick", type="std_srvs/SetBool", behaviour="echo")
    world.ros2.call("/bs/quick", SetBool, SetBool.Request(data=True))
    slow, quick = (world.ros2.node.create_client(SetBool, name) for name in ("/bs/held", "/bs/quick"))
    assert slow.wait_for_service(15.0)
    futures = [slow.call_async(SetBool.Request(data=True)) for _ in range(10)]
    for _ in futures:
        server.expect("request", service="/bs/held")
    assert quick.call(SetBool.Request(data=True), timeout_sec=HANGS_S).success
    assert not any(future.done() for future in futures)
    server.do("let_go")
    until(lambda: all(future.done() for future in futures), "all slow calls are answered")
    assert all(future.result().success for future in futures)
    for client in (slow, quick):
        world.ros2.node.destroy_client(client)
