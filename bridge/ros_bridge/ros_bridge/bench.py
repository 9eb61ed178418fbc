"""Measure the bridge from end to end: ``setup/in_ros2 python -m ros_bridge.bench``, with a ROS master at ROS_MASTER_URI.

The bridge runs as a process of its own. The ends are this process, rospy in one thread and rclpy in another, so that one steady clock
stamps both; each message carries its time of sending in its first bytes. The ends share an interpreter: their own cost is in the figures.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ros_bridge import raw
from ros_bridge.cli import set_up_ros1_environment
from ros_bridge.config import Direction, TopicRoute
from ros_bridge.conversion import TypePair, Types, ament_prefixes
from ros_bridge.stats import Durations
from ros_bridge.topics import interface_class, qos_profile

import rospy  # isort: skip - after ros_bridge.raw, which fetches it
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import serialize_message

START_WITHIN_S = 20.0
SETTLE_S = 1.0
ARRIVE_WITHIN_S = 5.0
SWITCH_INTERVAL_S = 0.0005


@dataclass(frozen=True)
class Case:
    """What to send: a type whose field ``data`` is filled to a size, a rate, a number."""

    name: str
    type_name: str
    size_bytes: int
    rate_hz: float
    number: int


CASES = (
    Case("string_64B", "std_msgs/String", 64, 200.0, 1000),
    Case("cloud_480kB", "sensor_msgs/PointCloud2", 480_000, 20.0, 100),
    Case("image_3.7MB", "sensor_msgs/Image", 1280 * 720 * 4, 15.0, 75),
)


def topic_name(case: Case, direction: Direction) -> str:
    """Return the case's topic."""
    return f"/bench/{case.name.replace('.', '_')}/{direction.value}"


def configuration() -> str:
    """Return the bridge's configuration for all cases, both ways."""
    lines = ["topics:"]
    for case in CASES:
        lines += [f"  - {{name: {topic_name(case, way)}, direction: {way.value}, type: {case.type_name}, depth: 10}}" for way in Direction]
    return "\n".join(lines) + "\n"


def payload(case: Case) -> bytes:
    """Return a message of the case as CDR whose payload bytes can be found and overwritten by a time stamp."""
    message = interface_class(case.type_name, "msg")()
    mark = MARK + b"." * (case.size_bytes - len(MARK))
    message.data = mark.decode() if isinstance(message.data, str) else mark
    return bytes(serialize_message(message))


MARK = b"#time-of-sending"  # 16 bytes: the stamp is written over it as 16 hexadecimal digits, so that it is text, too


def stamped(template: bytes | memoryview, position: int) -> bytes:
    """Return the template with the time now written at the mark's position."""
    message = bytearray(template)
    message[position : position + 16] = f"{time.monotonic_ns():016x}".encode()
    return bytes(message)


class Meter:
    """What arrived, and how long it took."""

    def __init__(self, position: int) -> None:
        self._position = position
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.durations = Durations()
        self.arrived = 0

    def wait_for(self, enough: Callable[[int], bool], publish: Callable[[], None]) -> None:
        """Call ``publish`` ten times a second until enough arrived, for at most ``ARRIVE_WITHIN_S``."""
        end_s = time.monotonic() + ARRIVE_WITHIN_S
        while not enough(self.arrived) and time.monotonic() < end_s:
            publish()
            time.sleep(0.1)

    def take(self, message: bytes) -> None:
        """Count a message."""
        now_ns = time.monotonic_ns()
        sent_ns = int(bytes(message[self._position : self._position + 16]), 16)
        self.durations.add(now_ns - sent_ns)
        self.arrived += 1


def send(case: Case, publish: Callable[[], None]) -> None:
    """Publish at the case's rate."""
    start_s = time.monotonic()
    for index in range(case.number):
        time.sleep(max(0.0, start_s + index / case.rate_hz - time.monotonic()))
        publish()


def measure(case: Case, direction: Direction, message: TypePair, node: rclpy.node.Node) -> Meter:
    """Send one case one way and return what arrived."""
    name = topic_name(case, direction)
    ros2_class = interface_class(case.type_name, "msg")
    qos = qos_profile(TopicRoute(name, name, direction, case.type_name))
    cdr = payload(case)
    ros1 = bytes(message.to_ros1(cdr))
    raw_class = raw.message_class(message)
    if direction is Direction.ROS1_TO_ROS2:
        meter = Meter(cdr.index(MARK))
        node.create_subscription(ros2_class, name, meter.take, qos, raw=True)
        publisher = rospy.Publisher(name, raw_class, queue_size=10, tcp_nodelay=True)
        template, position = ros1, ros1.index(MARK)

        def publish() -> None:
            publisher.publish(raw_class(stamped(template, position)))

    else:
        meter = Meter(ros1.index(MARK))
        rospy.Subscriber(name, raw_class, lambda received: meter.take(received.data), buff_size=262_144, tcp_nodelay=True)
        ros2_publisher = node.create_publisher(ros2_class, name, qos)
        position = cdr.index(MARK)

        def publish() -> None:
            ros2_publisher.publish(stamped(cdr, position))

    meter.wait_for(lambda arrived: arrived > 0, publish)
    time.sleep(SETTLE_S)  # the other probes arrive
    meter.reset()
    send(case, publish)
    meter.wait_for(lambda arrived: arrived >= case.number, lambda: None)
    return meter


def cpu_s() -> float:
    """Return the CPU time of ended children, in seconds."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def start_bridge(folder: Path) -> subprocess.Popen[str]:
    """Start the bridge and return when it runs."""
    (folder / "bench.yaml").write_text(configuration(), encoding="utf-8")
    command = [sys.executable, "-m", "ros_bridge", "--config", str(folder / "bench.yaml"), "--stats", str(folder / "stats.json")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    if process.stderr is None:
        raise RuntimeError("no pipe")
    for line in process.stderr:
        if "bridging" in line:
            break
    return process


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure all cases both ways and write the figures as JSON to standard output."""
    argparse.ArgumentParser(prog="ros_bridge.bench", description="Measures the bridge; needs a ROS master.").parse_args(arguments)
    set_up_ros1_environment()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    types = Types(ament_prefixes())
    rospy.init_node("ros_bridge_bench", anonymous=True, disable_signals=True, disable_rostime=True)
    rclpy.init(args=[])
    node = rclpy.create_node("ros_bridge_bench")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    figures: dict[str, object] = {}
    with tempfile.TemporaryDirectory() as folder:
        bridge = start_bridge(Path(folder))
        for case in CASES:
            for way in Direction:
                meter = measure(case, way, types.message(case.type_name), node)
                figures[f"{case.name} {way.value}"] = {
                    "received": f"{meter.arrived} of {case.number}",
                    "p50_ms": meter.durations.percentile_ms(0.5),
                    "p95_ms": meter.durations.percentile_ms(0.95),
                }
        peak_kb = int(Path(f"/proc/{bridge.pid}/status").read_text(encoding="utf-8").split("VmHWM:")[1].split()[0])
        bridge.terminate()
        bridge.wait(START_WITHIN_S)
        figures["inside"] = json.loads((Path(folder) / "stats.json").read_text(encoding="utf-8"))["topics"]
    figures["bridge"] = {"cpu_s": round(cpu_s(), 2), "peak_mb": round(peak_kb / 1024)}
    sys.stdout.write(json.dumps(figures, indent=1) + "\n")
    sys.stdout.flush()
    os._exit(0)  # as in cli.entry


if __name__ == "__main__":
    main()
