"""The native data plane among peers of every kind: latching ones, those that break off, those that speak no TCPROS, or too much of it."""

import json
import random
import socket
import struct
import threading
import time
from xmlrpc.client import ServerProxy
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_bridge_harness import RUNNING, BridgeProcess, Master, Ros1Peer, wait_until
from std_msgs.msg import String

from alula_flight.claims import free_port
from alula_testing.ros2 import spin

CONFIG = """
topics:
  - {name: /bp/up, direction: ros1_to_ros2, type: std_msgs/String, depth: 100}
  - {name: /bp/down, direction: ros2_to_ros1, type: std_msgs/String, depth: 100}
  - {name: /bp/up_latched, direction: ros1_to_ros2, type: std_msgs/String, latched: true, depth: 1}
  - {name: /bp/down_latched, direction: ros2_to_ros1, type: std_msgs/String, latched: true, depth: 1}
  - {name: /bp/flood, direction: ros1_to_ros2, type: std_msgs/String, depth: 10}
  - {name: /bp/fake, direction: ros1_to_ros2, type: std_msgs/String, depth: 100}
  - {ros1_name: /bp/fake, ros2_name: /bp/fake_too, direction: ros1_to_ros2, type: std_msgs/String, depth: 100}
"""
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SUM = "992ce8a1687cec8c8bd883ec73ca41d1"
LIMIT_S = 20.0


@pytest.fixture(scope="module")
def master():
    master = Master(free_port())
    master.start()
    yield master
    master.close()


@pytest.fixture(scope="module")
def bridge(master, ros2_domain, tmp_path_factory):
    process = BridgeProcess(master, tmp_path_factory.mktemp("plane"), CONFIG)
    process.wait_running()
    yield process
    process.close()


@pytest.fixture
def node(bridge):
    node = rclpy.create_node("plane_test_peer")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=spin, args=(executor,), daemon=True)
    thread.start()
    yield node
    executor.shutdown(timeout_sec=2.0)
    thread.join(2.0)
    node.destroy_node()


@pytest.fixture(autouse=True)
def leave_nothing_running(bridge):
    before = list(RUNNING)
    yield
    for process in RUNNING:
        if process not in before:
            process.close()
    RUNNING[:] = before


def texts(node, topic, qos=100):
    received = []
    node.create_subscription(String, topic, lambda message: received.append(message.data), qos)
    return received


def header(**fields):
    body = b"".join(struct.pack("<I", len(entry)) + entry for entry in (f"{name}={value}".encode() for name, value in fields.items()))
    return struct.pack("<I", len(body)) + body


def read_header(connection):
    length = struct.unpack("<I", exactly(connection, 4))[0]
    body, fields = exactly(connection, length), {}
    while body:
        size = struct.unpack("<I", body[:4])[0]
        name, _, value = body[4 : 4 + size].decode().partition("=")
        fields[name] = value
        body = body[4 + size :]
    return fields


def exactly(connection, size):
    data = b""
    while len(data) < size:
        part = connection.recv(size - len(data))
        assert part, "the connection was closed"
        data += part
    return data


def message(text):
    body = text.encode()
    return struct.pack("<II", len(body) + 4, len(body)) + body


def until_it_arrives(publisher, connection, text):
    """Publish until it comes out of a raw connection; what came before is passed over."""
    stop = threading.Event()

    def publish():
        while not stop.wait(0.05):
            publisher.publish(String(data=text))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        while True:
            length = struct.unpack("<I", exactly(connection, 4))[0]
            if exactly(connection, length)[4:] == text.encode():
                return
    finally:
        stop.set()
        thread.join()


def place_in_ros1(master, topic):
    """Ask the bridge's node where it sends a topic from, as a subscriber does."""
    proxy = ServerProxy(master.uri)
    publishers = dict(proxy.getSystemState("/plane_test")[2][0])[topic]
    assert publishers == ["/ros_bridge_topics"]
    uri = proxy.lookupNode("/plane_test", publishers[0])[2]
    code, _, (kind, host, port) = ServerProxy(uri).requestTopic("/plane_test", topic, [["TCPROS"]])
    assert (code, kind) == (1, "TCPROS")
    return host, port


def test_each_latching_publisher_in_ros1_keeps_its_message_for_late_joiners(node, master, bridge):
    peers = {text: Ros1Peer(master) for text in ("left", "right", "top")}
    early = texts(node, "/bp/up_latched", LATCHED)
    for text, peer in peers.items():
        peer.do("advertise", topic="/bp/up_latched", type="std_msgs/String", latch=True)
        peer.do("publish", topic="/bp/up_latched", values={"data": "old " + text})
        peer.do("publish", topic="/bp/up_latched", values={"data": text})
    wait_until(lambda: set(peers) <= set(early), f"all have crossed: {early}", LIMIT_S)
    late = texts(node, "/bp/up_latched", LATCHED)
    wait_until(lambda: set(late) == set(peers), f"a late joiner gets all of them: {late}", LIMIT_S)
    assert len(late) == 3


def test_each_transient_local_publisher_in_ros2_keeps_its_message_for_late_joiners(node, master, bridge):
    wanted = {(struct.pack("<I", len(text)) + text.encode()).hex() for text in ("left", "right")}
    publishers = [node.create_publisher(String, "/bp/down_latched", LATCHED) for _ in range(2)]
    publishers[0].publish(String(data="old"))
    for publisher, text in zip(publishers, ("left", "right"), strict=True):
        publisher.publish(String(data=text))
    first = Ros1Peer(master)
    first.do("subscribe", topic="/bp/down_latched", type="std_msgs/String")
    seen = set()
    while not wanted <= seen:
        seen.add(first.expect("message", topic="/bp/down_latched", within_s=LIMIT_S)["hex"])
    late = Ros1Peer(master)
    late.do("subscribe", topic="/bp/down_latched", type="std_msgs/String")
    assert {late.expect("message", topic="/bp/down_latched", within_s=LIMIT_S)["hex"] for _ in wanted} == wanted


def test_large_and_small_messages_keep_their_order_both_ways(node, master, bridge):
    received = texts(node, "/bp/up")
    publisher = node.create_publisher(String, "/bp/down", 100)
    peer = Ros1Peer(master)
    peer.do("advertise", topic="/bp/up", type="std_msgs/String")

    def arrives():
        peer.do("publish", topic="/bp/up", values={"data": "probe"})
        return received or time.sleep(0.05)

    wait_until(arrives, "the first message arrives", LIMIT_S)
    sent = [f"{number:03}" + "x" * (number % 3 * 200_000) for number in range(30)]
    for text in sent:
        peer.do("publish", topic="/bp/up", values={"data": text})
    wait_until(lambda: received[-1] == sent[-1], "the last arrives", LIMIT_S)
    assert [text for text in received if text != "probe"] == sent
    place = place_in_ros1(master, "/bp/down")
    with socket.create_connection(place, LIMIT_S) as connection:
        connection.sendall(header(callerid="/t", topic="/bp/down", type="*", md5sum="*"))
        read_header(connection)
        until_it_arrives(publisher, connection, "probe")
        for text in sent:
            publisher.publish(String(data=text))
            while (body := exactly(connection, struct.unpack("<I", exactly(connection, 4))[0])[4:]) == b"probe":
                pass
            assert body.decode() == text


def test_subscribers_are_checked_and_answered(node, master, bridge):
    place = place_in_ros1(master, "/bp/down")
    publisher = node.create_publisher(String, "/bp/down", 10)
    good = {"callerid": "/t", "topic": "/bp/down", "type": "std_msgs/String", "md5sum": SUM}
    for wrong, words in [
        ({"md5sum": "0" * 32}, "md5sum"),
        ({"type": "std_msgs/Int32"}, "std_msgs/Int32"),
        ({"topic": "/bp/nothing"}, "/bp/nothing"),
    ]:
        with socket.create_connection(place, LIMIT_S) as connection:
            connection.sendall(header(**good | wrong))
            assert words in read_header(connection)["error"]
            assert connection.recv(1) == b""
    for accepted in (good, good | {"type": "*", "md5sum": "*"}):
        with socket.create_connection(place, LIMIT_S) as connection:
            connection.sendall(header(**accepted))
            answer = read_header(connection)
            assert (answer["type"], answer["md5sum"], answer["latching"]) == ("std_msgs/String", SUM, "0")
            assert answer["callerid"] == "/ros_bridge_topics"
            assert "string data" in answer["message_definition"]
            until_it_arrives(publisher, connection, "for those who fit")


def test_garbage_on_the_listening_socket_harms_nobody(node, master, bridge):
    place = place_in_ros1(master, "/bp/down")
    publisher = node.create_publisher(String, "/bp/down", 10)
    chance = random.Random(7)  # noqa: S311
    whole = header(callerid="/t", topic="/bp/down", type="std_msgs/String", md5sum=SUM)
    with socket.create_connection(place, LIMIT_S) as bystander:
        bystander.sendall(whole)
        read_header(bystander)
        for number in range(200):
            garbage = bytearray(whole)
            for _ in range(chance.randrange(1, 4)):
                garbage[chance.randrange(len(garbage))] = chance.randrange(256)
            kind = number % 4
            data = [bytes(garbage), whole[: chance.randrange(len(whole))], chance.randbytes(300), whole + chance.randbytes(5000)][kind]
            with socket.create_connection(place, LIMIT_S) as connection:
                connection.sendall(data)
        until_it_arrives(publisher, bystander, "still here")
    assert bridge.process.poll() is None


class FakePublisher:
    """A ROS 1 publisher that answers each connection with given bytes and closes it."""

    def __init__(self, master, replies, topic="/bp/fake"):
        self.topic = topic
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.replies = list(replies)
        self.answered = 0
        self.server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
        self.server.register_function(self.request_topic, "requestTopic")
        self.uri = f"http://127.0.0.1:{self.server.server_address[1]}/"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        threading.Thread(target=self.serve, daemon=True).start()
        self.proxy = ServerProxy(master.uri)
        self.proxy.registerPublisher("/fake", topic, "std_msgs/String", self.uri)

    def request_topic(self, _caller, _topic, _protocols):
        return [1, "", ["TCPROS", "127.0.0.1", self.socket.getsockname()[1]]]

    def serve(self):
        while True:
            try:
                connection, _ = self.socket.accept()
            except OSError:
                return
            with connection:
                read_header(connection)
                connection.sendall(self.replies[min(self.answered, len(self.replies) - 1)])
                self.answered += 1
                connection.shutdown(socket.SHUT_WR)
                connection.recv(1)

    def close(self):
        self.proxy.unregisterPublisher("/fake", self.topic, self.uri)
        self.server.shutdown()
        self.server.server_close()
        self.socket.close()


def test_publisher_that_breaks_off_or_talks_nonsense_is_tried_again_and_harms_nobody(node, master, bridge):
    """Two routes lead from the topic, so each reply goes to two connections; all of them are tried again until the good message comes."""
    received, too = texts(node, "/bp/fake"), texts(node, "/bp/fake_too")
    greeting = header(callerid="/fake", type="std_msgs/String", md5sum=SUM, latching="0", topic="/bp/fake")
    replies = [
        b"",
        greeting[:20],
        b"\xff" * 400,
        greeting + struct.pack("<I", 4_000_000) + b"x" * 2_000_000,  # killed in the middle of a 4 MB message
        greeting + struct.pack("<I", 0xFFFFFFF0) + b"x" * 1000,
        greeting + struct.pack("<II", 4, 0xFFFFFFFF) + message("behind nonsense"),
        greeting + message("good") * 3,
    ]
    # A reply that does not fit makes the bridge wait 5 s, and that is not what is tested: each such reply has a publisher of its own.
    for index, reply in enumerate(replies):
        fake = FakePublisher(master, [reply])
        wait_until(lambda fake=fake: fake.answered >= 2, f"both routes connect for reply {index}", LIMIT_S)
        if index >= 5:
            words = "good" if index == 6 else "behind nonsense"
            wait_until(lambda words=words: words in received and words in too, f"'{words}' arrives on both", LIMIT_S)
        fake.close()
    assert {"good", "behind nonsense"} == set(received) == set(too)
    figures = {}

    def counted():
        figures.update(json.loads(bridge.stats_file.read_text())["topics"]) if bridge.stats_file.is_file() else None
        return figures.get("/bp/fake", {}).get("errors", 0) >= 1

    wait_until(counted, "the message that is none is counted", LIMIT_S)


def test_lost_publisher_is_found_again_within_two_seconds(node, master, bridge):
    received = texts(node, "/bp/fake")
    greeting = header(callerid="/fake", type="std_msgs/String", md5sum=SUM, latching="0", topic="/bp/fake")
    fake = FakePublisher(master, [b"", b"", b"", greeting + message("again")])
    start = time.monotonic()
    wait_until(lambda: "again" in received, "it is tried again", LIMIT_S)
    assert time.monotonic() - start < 10.0  # 0.1 s, 0.2 s, 0.4 s of waiting, and a loaded machine
    fake.close()


def test_flood_crosses_in_order_and_what_has_to_go_is_counted(node, master, bridge):
    """20000 messages at once on a route of depth 10: the newest get through, and each is either counted as crossed or as dropped."""
    received = texts(node, "/bp/flood", 20_000)
    greeting = header(callerid="/fake", type="std_msgs/String", md5sum=SUM, latching="0", topic="/bp/flood")
    probe = FakePublisher(master, [greeting + message("(probe)")], "/bp/flood")
    wait_until(lambda: received, "a probe arrives: the ends in ROS 2 know each other", LIMIT_S)
    probe.close()
    fake = FakePublisher(master, [greeting + b"".join(message(f"{number:05}") for number in range(20_000)), greeting], "/bp/flood")
    wait_until(lambda: received[-1] == "19999", "the last one arrives", LIMIT_S)
    assert received == sorted(received)
    figures = {}
    sent = 20_000 + probe.answered

    def counted():
        figures.update(json.loads(bridge.stats_file.read_text())["topics"]["/bp/flood"])
        return figures["count"] + figures["dropped"] >= sent

    wait_until(counted, f"all are counted: {figures}", LIMIT_S)
    assert figures["count"] + figures["dropped"] == sent
    assert len(received) <= figures["count"]
    fake.close()
