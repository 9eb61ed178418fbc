"""The bridge as a process between a real ROS master with a rospy peer and a DDS domain with this process as rclpy peer."""

import json
import os
import signal
import struct
import threading
import time
from collections.abc import Callable

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from ros_bridge_harness import RUNNING, BridgeProcess, Master, Ros1Peer, wait_until
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import Empty, SetBool
from uav_msgs.msg import GuidanceState

from alula_flight.claims import free_port
from alula_testing.ros2 import spin
from ros_bridge.conversion import Types, ament_prefixes

CONFIG = """
topics:
  - {name: /clock, direction: ros1_to_ros2, type: rosgraph_msgs/Clock}
  - {name: /bt/up, direction: ros1_to_ros2, type: std_msgs/String, depth: 200}
  - {name: /bt/down, direction: ros2_to_ros1, type: std_msgs/String, depth: 200}
  - {name: /bt/up_latched, direction: ros1_to_ros2, type: std_msgs/String, latched: true, depth: 1}
  - {name: /bt/down_latched, direction: ros2_to_ros1, type: std_msgs/String, latched: true, depth: 1}
  - {ros1_name: /bt/state_up, ros2_name: /bt/renamed_up, direction: ros1_to_ros2, type: uav_msgs/GuidanceState}
  - {name: /bt/state_down, direction: ros2_to_ros1, type: uav_msgs/GuidanceState}
  - {name: /bt/pose_down, direction: ros2_to_ros1, type: geometry_msgs/PoseStamped, depth: 3}
services:
  - {name: /bt/in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 4.0}
  - {name: /bt/in_ros1_hasty, server: ros1, type: std_srvs/SetBool, timeout_s: 0.5}
  - {name: /bt/in_ros1_plain, server: ros1, type: std_srvs/Empty, timeout_s: 0.5}
  - {name: /bt/in_ros2, server: ros2, type: std_srvs/SetBool, timeout_s: 4.0}
  - {name: /bt/in_ros2_hasty, server: ros2, type: std_srvs/SetBool, timeout_s: 0.5}
"""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
STATE = {
    "header": {"stamp": {"secs": 3, "nsecs": 4}, "frame_id": "map"},
    "mode": "GUIDED",
    "landed_state": 2,
    "authority": True,
    "position_enu_m": {"x": 1.5, "y": -2.5, "z": 3.25},
    "reference": "position",
    "reference_id": 4_000_000_000,
    "obstacle_m": 1e300,
}


class Ros2Peer:
    """An rclpy node spun in a thread, in the domain of the tests."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("bridge_test_peer")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=spin, args=(self.executor,), daemon=True)
        self.thread.start()
        self.ends: list[tuple[Callable, object]] = []

    def subscribe(self, topic: str, kind: type, qos: QoSProfile | int = 100, **options: bool) -> list:
        received: list = []
        subscription = self.node.create_subscription(kind, topic, received.append, qos, **options)
        self.ends.append((self.node.destroy_subscription, subscription))
        return received

    def publisher(self, topic: str, kind: type, qos: QoSProfile | int = 100):
        publisher = self.node.create_publisher(kind, topic, qos)
        self.ends.append((self.node.destroy_publisher, publisher))
        wait_until(lambda: publisher.get_subscription_count() > 0, f"the bridge subscribes to {topic} in ROS 2")
        return publisher

    def serve(self, service: str, handle: Callable) -> object:
        server = self.node.create_service(SetBool, service, handle)
        self.ends.append((self.node.destroy_service, server))
        return server

    def call(self, service: str, kind: type, request: object, within_s: float = 10.0):
        """Return the response and how many seconds it took, or None when there was none in time."""
        client = self.node.create_client(kind, service)
        self.ends.append((self.node.destroy_client, client))
        assert client.wait_for_service(20.0)
        start = time.monotonic()
        response = client.call(request, timeout_sec=within_s)
        return response, time.monotonic() - start

    def tidy(self) -> None:
        while self.ends:
            destroy, entity = self.ends.pop()
            destroy(entity)

    def close(self) -> None:
        self.executor.shutdown(timeout_sec=2.0)
        self.thread.join(2.0)
        self.node.destroy_node()


@pytest.fixture(scope="module")
def master():
    master = Master(free_port())
    master.start()
    yield master
    master.close()


@pytest.fixture(scope="module")
def bridge(master, ros2_domain, tmp_path_factory):
    process = BridgeProcess(master, tmp_path_factory.mktemp("bridge"), CONFIG)
    process.wait_running()
    yield process
    process.close()


@pytest.fixture(scope="module")
def peers(bridge, master):
    ros1, ros2 = Ros1Peer(master), Ros2Peer()
    yield ros1, ros2
    ros1.close()
    ros2.close()


@pytest.fixture(autouse=True)
def leave_nothing_running(peers):
    before = list(RUNNING)
    yield
    for process in RUNNING:
        if process not in before:
            process.close()
    RUNNING[:] = before


@pytest.fixture
def ros1(peers):
    return peers[0]


@pytest.fixture
def ros2(peers):
    yield peers[1]
    peers[1].tidy()


def open_up(ros1, ros2, topic, kind, ros1_type, *, ros2_topic=None, values=None, **options):
    """Subscribe in ROS 2, advertise in ROS 1, and publish until the first message arrives; return the list of what arrives.

    A volatile reader that has found its writer may still be unknown to it, and ROS 1 has the like: only a message that has come tells.
    """
    received = ros2.subscribe(ros2_topic or topic, kind, **options)
    ros1.do("advertise", topic=topic, type=ros1_type)

    def arrives():
        ros1.do("publish", topic=topic, values=values or {})
        return received or time.sleep(0.05)

    wait_until(arrives, f"the first message on {topic} arrives in ROS 2")
    return received


def test_every_message_of_a_burst_crosses_to_ros2_in_order(ros1, ros2):
    received = open_up(ros1, ros2, "/bt/up", String, "std_msgs/String")
    texts = [f"ü{number}" for number in range(50)]
    for text in texts:
        ros1.do("publish", topic="/bt/up", values={"data": text})
    wait_until(lambda: received[-1].data == texts[-1], "the last one arrives")
    assert [message.data for message in received if message.data] == texts


def test_every_message_of_a_burst_crosses_to_ros1_in_order(ros1, ros2):
    publisher = ros2.publisher("/bt/down", String, 200)
    ros1.do("subscribe", topic="/bt/down", type="std_msgs/String")
    wait_ros1_receives(ros1, publisher, "/bt/down")
    for number in range(50):
        publisher.publish(String(data=f"ü{number}"))
    for number in range(50):
        event = ros1.expect("message", topic="/bt/down")
        text = f"ü{number}".encode()
        assert bytes.fromhex(event["hex"]) == struct.pack("<I", len(text)) + text
        assert not event["latched"]


def wait_ros1_receives(ros1, publisher, topic):
    """Publish until the first message arrives in ROS 1, and pass over all of these."""
    stop = threading.Event()

    def probe():
        while not stop.wait(0.05):
            publisher.publish(publisher.msg_type())

    thread = threading.Thread(target=probe)
    thread.start()
    ros1.expect("message", topic=topic)
    stop.set()
    thread.join()
    if publisher.msg_type is String:
        publisher.publish(String(data="last"))
        ros1.expect("message", topic=topic, hex=(struct.pack("<I", 4) + b"last").hex())


def test_late_joiner_in_ros2_gets_the_latched_message(ros1, ros2):
    ros1.do("advertise", topic="/bt/up_latched", type="std_msgs/String", latch=True)
    ros1.do("publish", topic="/bt/up_latched", values={"data": "old"})
    ros1.do("publish", topic="/bt/up_latched", values={"data": "the last"})
    first = ros2.subscribe("/bt/up_latched", String, LATCHED)
    wait_until(lambda: first and first[-1].data == "the last", "the first late joiner gets it")
    second = ros2.subscribe("/bt/up_latched", String, LATCHED)
    wait_until(lambda: second, "the second late joiner gets it too")
    assert [message.data for message in second] == ["the last"]


def test_late_joiner_in_ros1_gets_the_transient_local_message(ros1, ros2, master):
    publisher = ros2.publisher("/bt/down_latched", String, LATCHED)
    publisher.publish(String(data="kept"))
    wanted = (struct.pack("<I", 4) + b"kept").hex()
    ros1.do("subscribe", topic="/bt/down_latched", type="std_msgs/String")
    assert ros1.expect("message", topic="/bt/down_latched", hex=wanted)["latched"]
    later = Ros1Peer(master)
    later.do("subscribe", topic="/bt/down_latched", type="std_msgs/String")
    later.expect("message", topic="/bt/down_latched", hex=wanted)
    later.close()


def test_clock_crosses_at_50_hz_in_less_than_a_millisecond_inside(ros1, ros2, bridge):
    received = open_up(ros1, ros2, "/clock", Clock, "rosgraph_msgs/Clock")
    for tick in range(1, 101):
        ros1.do("publish", topic="/clock", values={"clock": {"secs": tick, "nsecs": 5}})
        time.sleep(0.02)  # the rate is what is tested
    wait_until(lambda: received[-1].clock.sec == 100, "the last tick arrives")
    ticks = [(message.clock.sec, message.clock.nanosec) for message in received if message.clock.sec]
    assert ticks == [(tick, 5) for tick in range(1, 101)]
    figures = wait_for_figures(bridge, "/clock", 100)
    assert figures["p50_ms"] < 1.0
    assert figures["dropped"] == figures["errors"] == 0


def wait_for_figures(bridge, topic, count):
    def figures():
        return json.loads(bridge.stats_file.read_text())["topics"][topic] if bridge.stats_file.is_file() else {"count": 0}

    wait_until(lambda: figures()["count"] >= count, f"the statistics count {count} of {topic}")
    return figures()


def test_custom_type_crosses_to_ros2_byte_for_byte_under_another_name(ros1, ros2):
    received = open_up(
        ros1, ros2, "/bt/state_up", GuidanceState, "uav_msgs/GuidanceState", ros2_topic="/bt/renamed_up", values=STATE, raw=True
    )
    sent = bytes.fromhex(ros1.expect("published", topic="/bt/state_up")["hex"])
    message = deserialize_message(received[0], GuidanceState)
    assert message.position_enu_m.y == -2.5
    assert message.reference_id == 4_000_000_000
    returned = bytes(Types(ament_prefixes()).message("uav_msgs/GuidanceState").to_ros1(serialize_message(message)))
    assert returned[4:].hex() == sent[4:].hex()


def test_custom_type_crosses_to_ros1_byte_for_byte_with_its_own_sequence(ros1, ros2):
    publisher = ros2.publisher("/bt/state_down", GuidanceState)
    ros1.do("subscribe", topic="/bt/state_down", type="uav_msgs/GuidanceState")
    wait_ros1_receives(ros1, publisher, "/bt/state_down")
    state = GuidanceState(mode="LAND", reference="land", yaw_rad=0.5, obstacle_m=float("inf"), heading_locked=True)
    state.header.frame_id = "map"
    state.header.stamp.sec = 77
    publisher.publish(state)
    wanted = bytes(Types(ament_prefixes()).message("uav_msgs/GuidanceState").to_ros1(serialize_message(state)))
    before = None
    while True:
        received = bytes.fromhex(ros1.expect("message", topic="/bt/state_down")["hex"])
        sequence = struct.unpack("<I", received[:4])[0]
        assert before is None or sequence == before + 1
        before = sequence
        if received[4:] == wanted[4:]:
            break


def test_publisher_of_another_type_is_refused_and_the_route_lives(ros1, ros2, master):
    wrong = Ros1Peer(master)
    wrong.do("advertise", topic="/bt/up", type="std_msgs/Float64")
    wrong.do("publish", topic="/bt/up", values={"data": 1.0})
    received = open_up(ros1, ros2, "/bt/up", String, "std_msgs/String", values={"data": "good"})
    wrong.do("connections", topic="/bt/up")
    assert wrong.expect("connections")["number"] == 0
    assert {message.data for message in received} == {"good"}
    wrong.close()


def test_heartbeat_in_both_worlds(ros1, ros2):
    beats = ros2.subscribe("/ros_bridge/state", String, LATCHED)
    ros1.do("subscribe", topic="/ros_bridge/state", type="std_msgs/String")
    wait_until(lambda: len(beats) >= 3, "three heartbeats in ROS 2")
    states = [json.loads(beat.data) for beat in beats[:3]]
    assert [state["sequence"] - states[0]["sequence"] for state in states] == [0, 1, 2]
    assert {state["state"] for state in states} == {"running"}
    assert states[0]["ros1_master"] is True
    text = bytes.fromhex(ros1.expect("message", topic="/ros_bridge/state")["hex"])[4:]
    assert json.loads(text)["topics"] == 8


def test_ros2_client_calls_a_ros1_server_until_it_goes_and_its_successor_comes(ros2, master):
    for _ in range(2):
        server = Ros1Peer(master)
        server.do("serve", service="/bt/in_ros1", type="std_srvs/SetBool", behaviour="echo")
        for data in (True, False, True):
            response, _ = ros2.call("/bt/in_ros1", SetBool, SetBool.Request(data=data))
            assert (response.success, response.message) == (data, "from ROS 1")
            assert server.expect("request")["hex"] == ("01" if data else "00")
        server.close()


def test_ros2_client_gets_a_refusal_when_there_is_no_ros1_server(ros2, bridge):
    response, seconds = ros2.call("/bt/in_ros1_hasty", SetBool, SetBool.Request(data=True))
    assert response.success is False
    assert "no server" in response.message
    assert 0.4 < seconds < 2.0


def test_response_without_a_flag_is_not_sent_at_all(ros2, bridge):
    response, _ = ros2.call("/bt/in_ros1_plain", Empty, Empty.Request(), within_s=1.5)
    assert response is None


@pytest.mark.parametrize(("behaviour", "reason"), [("raise", "the handler is broken"), ("die", "ended in the call"), ("slow", "timed out")])
def test_ros2_client_gets_a_refusal_when_the_ros1_server_fails(ros2, master, behaviour, reason):
    service = "/bt/in_ros1_hasty" if behaviour == "slow" else "/bt/in_ros1"
    server = Ros1Peer(master)
    server.do("serve", service=service, type="std_srvs/SetBool", behaviour=behaviour, seconds=3.0)
    replies: list = []
    caller = threading.Thread(target=lambda: replies.append(ros2.call(service, SetBool, SetBool.Request(data=True))))
    caller.start()
    server.expect("request")
    caller.join()
    response, seconds = replies[0]
    assert response.success is False
    assert reason in response.message
    assert seconds < 3.0
    server.close()


def test_ros1_client_calls_a_ros2_server(ros1, ros2):
    def handle(request, response):
        response.success = not request.data
        response.message = "from ROS 2"
        return response

    ros2.serve("/bt/in_ros2", handle)
    ros1.do("call", service="/bt/in_ros2", type="std_srvs/SetBool", values={"data": False})
    assert ros1.expect("called", "call_failed")["text"] == 'success: True\nmessage: "from ROS 2"'


def test_ros1_client_gets_an_error_when_there_is_no_ros2_server(ros1):
    ros1.do("call", service="/bt/in_ros2_hasty", type="std_srvs/SetBool", values={"data": True})
    assert "no server for /bt/in_ros2_hasty in ROS 2" in ros1.expect("called", "call_failed")["reason"]


def test_ros1_client_gets_an_error_when_the_ros2_server_raises_or_goes(ros1, ros2):
    taken = threading.Event()
    gone = threading.Event()
    server_node = rclpy.create_node("bridge_test_server")

    def handle(_request, _response):
        taken.set()
        gone.wait(5.0)
        raise ValueError("broken")

    server_node.create_service(SetBool, "/bt/in_ros2", handle)
    executor = SingleThreadedExecutor()
    executor.add_node(server_node)

    def spin():
        try:
            executor.spin()
        except ValueError:
            server_node.destroy_node()

    thread = threading.Thread(target=spin)
    thread.start()
    ros1.do("call", service="/bt/in_ros2", type="std_srvs/SetBool", values={"data": True})
    assert taken.wait(5.0)
    start = time.monotonic()
    gone.set()
    assert "ended in the call" in ros1.expect("called", "call_failed")["reason"]
    assert time.monotonic() - start < 2.0
    thread.join()
    executor.shutdown()


def test_slow_services_stall_no_topic(ros1, ros2, master):
    """Four calls of 2 s one way and one the other, while a topic runs at 100 Hz: nothing is lost or late."""
    slow = Ros1Peer(master)
    slow.do("serve", service="/bt/in_ros1", type="std_srvs/SetBool", behaviour="slow", seconds=2.0)
    slow.do("subscribe", topic="/bt/down", type="std_msgs/String")
    publisher = ros2.publisher("/bt/down", String, 200)
    wait_ros1_receives(slow, publisher, "/bt/down")
    replies: list = []
    callers = [threading.Thread(target=lambda: replies.append(ros2.call("/bt/in_ros1", SetBool, SetBool.Request()))) for _ in range(2)]
    for caller in callers:
        caller.start()
    slow.expect("request")
    slow.expect("request")
    start = time.monotonic()
    for number in range(100):
        publisher.publish(String(data=f"{number:03}"))
        time.sleep(0.01)  # the rate is what is tested
        event = slow.expect("message", topic="/bt/down", within_s=0.5)
        assert bytes.fromhex(event["hex"])[4:] == f"{number:03}".encode()
    assert time.monotonic() - start < 1.9  # so all of it happened while the calls were under way
    for caller in callers:
        caller.join()
    assert [response.message for response, _ in replies] == ["from ROS 1"] * 2
    slow.close()


def test_subscriber_that_does_not_read_loses_the_oldest_and_stalls_nobody(ros2, master, bridge):
    """A stopped ROS 1 process: its socket fills up, drops are counted, the other subscriber gets everything."""
    stopped, alive = Ros1Peer(master), Ros1Peer(master)
    publisher = ros2.publisher("/bt/pose_down", PoseStamped)
    for peer in (stopped, alive):
        peer.do("subscribe", topic="/bt/pose_down", type="geometry_msgs/PoseStamped")
        wait_ros1_receives(peer, publisher, "/bt/pose_down")
    os.killpg(stopped.process.pid, signal.SIGSTOP)
    big = PoseStamped()
    big.header.frame_id = "x" * 1_000_000
    for number in range(20):
        big.pose.position.x = float(number)
        publisher.publish(big)
        while True:  # probes of wait_ros1_receives may be in between
            received = bytes.fromhex(alive.expect("message", topic="/bt/pose_down")["hex"])
            if len(received) > 1_000_000:
                break
        assert struct.unpack("<d", received[-56:-48])[0] == number
    wait_until(lambda: wait_for_figures(bridge, "/bt/pose_down", 20)["dropped"] > 0, "drops are counted")
    os.killpg(stopped.process.pid, signal.SIGCONT)
    stopped.close()
    alive.close()


def test_interrupt_ends_the_bridge_within_two_seconds_with_its_figures(master, ros2_domain, tmp_path):
    config = "topics:\n  - {name: /bt_end, direction: ros1_to_ros2, type: std_msgs/String}\n"
    for number in (signal.SIGINT, signal.SIGTERM):
        process = BridgeProcess(master, tmp_path / number.name, config)
        process.wait_running()
        start = time.monotonic()
        process.process.send_signal(number)
        assert process.process.wait(5.0) == 0
        assert time.monotonic() - start < 2.0
        about = {"ros2_name": "/bt_end", "direction": "ros1_to_ros2", "type": "std_msgs/String", "rate_hz": 0.0}
        figures = {"count": 0, "bytes": 0, "p50_ms": None, "p95_ms": None, "dropped": 0, "errors": 0, "dropped_why": {}}
        assert json.loads(process.stats_file.read_text()) == {"topics": {"/bt_end": about | figures}, "services": {}, "actions": {}}


def test_interrupt_ends_a_bridge_that_waits_for_its_master(ros2_domain, tmp_path):
    nobody = Master(free_port())
    process = BridgeProcess(nobody, tmp_path, "topics: []\n")
    wait_until(lambda: any("waiting for a ROS master" in line for line in process.lines), "it says that it waits", 20.0)
    process.process.send_signal(signal.SIGTERM)
    assert process.process.wait(2.0) == 0


def test_wrong_configuration_ends_with_2_and_wrong_type_with_1(master, ros2_domain, tmp_path):
    for config, code, words in [
        ("topics:\n  - {nmae: /a}", 2, "bridge.yaml:2: unknown key 'nmae'"),
        ("topics:\n  - {name: /a, direction: ros1_to_ros2, type: no_msgs/No}", 1, "no_msgs/No"),
    ]:
        process = BridgeProcess(master, tmp_path / str(code), config)
        assert process.process.wait(20.0) == code
        wait_until(lambda process=process, words=words: any(words in line for line in process.lines), f"{words} in {process.lines}")


def test_waits_for_the_master_with_one_message_and_survives_its_restart(ros2_domain, tmp_path):
    master = Master(free_port())
    process = BridgeProcess(master, tmp_path, "topics:\n  - {name: /bt_restart, direction: ros1_to_ros2, type: std_msgs/String}\n")
    wait_until(lambda: process.lines, "it says that it waits", 20.0)
    ros2 = Ros2Peer()
    master.start()
    process.wait_running()
    assert sum("waiting for a ROS master" in line for line in process.lines) == 1
    master.close()
    wait_until(lambda: any("does not answer" in line for line in process.lines), "it notices")
    master.start()
    peer = Ros1Peer(master)
    received = open_up(peer, ros2, "/bt_restart", String, "std_msgs/String", values={"data": "after the restart"})
    assert received[0].data == "after the restart"
    peer.close()
    assert process.close() < 2.0
    ros2.tidy()
    ros2.close()
    master.close()
