"""rclpy's ends of the bridge's live tests, and the opening of routes: a message that has come tells that the next one will."""

import json
import struct
import threading
import time
from collections.abc import Callable

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_bridge_harness import PROBE_S
from std_msgs.msg import String
from std_srvs.srv import SetBool

from alula_testing.ros2 import spin
from alula_testing.waits import HANGS_S, until

RELIABLE = QoSProfile(depth=20)
BEST_EFFORT = QoSProfile(depth=20, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)


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
        self.listen(topic, kind, received.append, qos, **options)
        return received

    def listen(self, topic: str, kind: type, take: Callable, qos: QoSProfile | int = 100, **options: bool) -> None:
        subscription = self.node.create_subscription(kind, topic, take, qos, **options)
        self.ends.append((self.node.destroy_subscription, subscription))

    def publisher(self, topic: str, kind: type, qos: QoSProfile | int = 100):
        publisher = self.node.create_publisher(kind, topic, qos)
        self.ends.append((self.node.destroy_publisher, publisher))
        until(lambda: publisher.get_subscription_count() > 0, f"the bridge subscribes to {topic} in ROS 2")
        return publisher

    def serve(self, service: str, handle: Callable) -> object:
        server = self.node.create_service(SetBool, service, handle)
        self.ends.append((self.node.destroy_service, server))
        return server

    def call(self, service: str, kind: type, request: object, within_s: float = HANGS_S):
        """Return the response, or None when there was none in time."""
        client = self.node.create_client(kind, service)
        self.ends.append((self.node.destroy_client, client))
        assert client.wait_for_service(HANGS_S)
        return client.call(request, timeout_sec=within_s)

    def tidy(self) -> None:
        while self.ends:
            destroy, entity = self.ends.pop()
            destroy(entity)

    def close(self) -> None:
        self.executor.shutdown(timeout_sec=2.0)
        self.thread.join(2.0)
        self.node.destroy_node()


def paced(probe: Callable[[], object]) -> Callable[[], None]:
    """Return what sends a probe, at most every ``PROBE_S``: more would push what comes after them out of queues."""
    next_s = 0.0

    def send() -> None:
        nonlocal next_s
        now_s = time.monotonic()
        if now_s >= next_s:
            next_s = now_s + PROBE_S
            probe()

    return send


class Ros2Node:
    """An rclpy node spun in this thread, whenever something is waited for."""

    def __init__(self, name: str) -> None:
        self.node = rclpy.create_node(name)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def until(self, condition, what, timeout_s=HANGS_S):
        def spin_and_ask():
            self.executor.spin_once(timeout_sec=0.02)
            return condition()

        until(spin_and_ask, what, timeout_s, every_s=0.0)

    def subscribe(self, topic, kind, qos=RELIABLE, **options):
        received: list = []
        self.node.create_subscription(kind, topic, received.append, qos, **options)
        return received

    def publisher(self, topic, kind, qos=RELIABLE):
        return self.node.create_publisher(kind, topic, qos)

    def call(self, service, kind, request):
        client = self.node.create_client(kind, service)
        self.until(client.service_is_ready, f"{service} is there")
        future = client.call_async(request)
        self.until(future.done, f"{service} answers")
        return future.result()

    def close(self):
        self.executor.shutdown(timeout_sec=2.0)
        self.node.destroy_node()


def open_up(ros1, ros2, topic, kind, ros1_type, *, ros2_topic=None, values=None, **options):
    """Subscribe in ROS 2, advertise in ROS 1, and publish until the first message arrives; return the list of what arrives.

    A volatile reader that has found its writer may still be unknown to it, and ROS 1 has the like: only a message that has come tells.
    """
    received = ros2.subscribe(ros2_topic or topic, kind, **options)
    ros1.do("advertise", topic=topic, type=ros1_type)

    def arrives():
        ros1.do("publish", topic=topic, values=values or {})
        return received

    until(arrives, f"the first message on {topic} arrives in ROS 2", every_s=PROBE_S)
    return received


def wait_ros1_receives(ros1, publisher, topic):
    """Publish until the first message arrives in ROS 1, and pass over all of these."""
    stop = threading.Event()

    def probe():
        while not stop.wait(PROBE_S):
            publisher.publish(publisher.msg_type())

    thread = threading.Thread(target=probe)
    thread.start()
    ros1.expect("message", topic=topic)
    stop.set()
    thread.join()
    if publisher.msg_type is String:
        publisher.publish(String(data="last"))
        ros1.expect("message", topic=topic, hex=(struct.pack("<I", 4) + b"last").hex())


def wait_for_figures(bridge, topic, count):
    def figures():
        return json.loads(bridge.stats_file.read_text())["topics"][topic] if bridge.stats_file.is_file() else {"count": 0}

    until(lambda: figures()["count"] >= count, f"the statistics count {count} of {topic}")
    return figures()


def text_of(event):
    return bytes.fromhex(event["hex"])[4:].decode()


def hex_of(text):
    return (struct.pack("<I", len(text)) + text.encode()).hex()
