"""The ROS 2 end of the benchmark: a plain rclpy node, reliable and with a queue as ordered. See ``bench_ends/protocol.py``."""

from __future__ import annotations

import array
import os
import sys
import threading
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import String
from std_srvs.srv import SetBool

from bridge_tools.bench_ends import protocol

READY_S = 60.0


def message_of(kind: str, size_bytes: int) -> Any:
    """Return a message with that many bytes of payload."""
    if kind == "string":
        return String(data="." * size_bytes)
    data = array.array("B", bytes(size_bytes))
    if kind == "image":
        return Image(height=size_bytes // 4 // 1280, width=1280, encoding="32FC1", step=5120, data=data)
    fields = [PointField(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate("xyzi")]
    return PointCloud2(height=1, width=size_bytes // 16, fields=fields, point_step=16, row_step=size_bytes, data=data)


def stamp(message: Any, time_ns: int) -> None:
    """Write the time of sending into a message."""
    if isinstance(message, String):
        message.data = protocol.text_stamp(time_ns) + message.data[protocol.STAMP_CHARACTERS :]
    else:
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time_ns, 1_000_000_000)


def stamp_of(message: Any) -> int:
    """Return the time of sending."""
    if isinstance(message, String):
        return protocol.read_text_stamp(message.data)
    return int(message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec)


TYPES = {"string": String, "image": Image, "cloud": PointCloud2}


def send(order: protocol.Order, node: Node) -> None:
    """Publish messages of the ordered kind and size, at the ordered rate."""
    publishers = [node.create_publisher(TYPES[order["kind"]], topic, order["queue"]) for topic in order["topics"]]
    message = message_of(order["kind"], order["size_bytes"])
    protocol.send(order, [publisher.publish for publisher in publishers], message, stamp)


def receive(order: protocol.Order, node: Node) -> None:
    """Subscribe to the ordered topics, and report how many messages came and how late."""
    meter = protocol.Meter(order["topics"])

    def taker(topic: str) -> Any:
        return lambda message: meter.take(topic, stamp_of(message))

    for topic in order["topics"]:
        node.create_subscription(TYPES[order["kind"]], topic, taker(topic), order["queue"])
    _spin(node)
    protocol.receive(meter)


def serve(order: protocol.Order, node: Node) -> None:
    """Serve a SetBool service until told to finish."""

    def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success, response.message = request.data, "done"
        return response

    node.create_service(SetBool, order["topics"][0], answer)
    _spin(node)
    protocol.report(event="ready")
    protocol.wait_for("finish")


def call(order: protocol.Order, node: Node) -> None:
    """Call one behind the other."""
    client = node.create_client(SetBool, order["topics"][0])
    client.wait_for_service(READY_S)
    _spin(node)
    protocol.call(order, lambda data: client.call(SetBool.Request(data=data), timeout_sec=READY_S).success)


def _spin(node: Node) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()


def main() -> None:
    """Do what the order says."""
    order = protocol.read_order()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)  # the bench ends us by SIGTERM, without ado
    node = rclpy.create_node(f"bench_end_{os.getpid()}")
    {"send": send, "receive": receive, "serve": serve, "call": call}[order["do"]](order, node)
    sys.stdout.flush()
    os._exit(0)  # the executor's thread is in the middle of a wait


if __name__ == "__main__":
    main()
