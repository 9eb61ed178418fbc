"""The ROS 1 end of the benchmark: a plain rospy node, run by the ROS 1 world's interpreter. See ``bench_ends/protocol.py``."""

import os
import sys
import warnings
from typing import Any

import protocol  # type: ignore[import-not-found]  # beside this file, where Python looks first; it is in no package of the ROS 1 world
import rospy
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import String
from std_srvs.srv import SetBool, SetBoolResponse

PROBE_S = 60.0


def message_of(kind: str, size_bytes: int) -> Any:
    """Return a message with that many bytes of payload."""
    if kind == "string":
        return String(data="." * size_bytes)
    if kind == "image":
        return Image(height=size_bytes // 4 // 1280, width=1280, encoding="32FC1", step=5120, data=bytes(size_bytes))
    fields = [PointField(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate("xyzi")]
    return PointCloud2(height=1, width=size_bytes // 16, fields=fields, point_step=16, row_step=size_bytes, data=bytes(size_bytes))


def stamp(message: Any, time_ns: int) -> None:
    """Write the time of sending into a message."""
    if isinstance(message, String):
        message.data = protocol.text_stamp(time_ns) + message.data[protocol.STAMP_CHARACTERS :]
    else:
        message.header.stamp.secs, message.header.stamp.nsecs = divmod(time_ns, 1_000_000_000)


def stamp_of(message: Any) -> int:
    """Return the time of sending."""
    if isinstance(message, String):
        return int(protocol.read_text_stamp(message.data))
    return int(message.header.stamp.secs * 1_000_000_000 + message.header.stamp.nsecs)


TYPES = {"string": String, "image": Image, "cloud": PointCloud2}


def send(order: protocol.Order) -> None:
    """Publish messages of the ordered kind and size, at the ordered rate."""
    warnings.filterwarnings("ignore", category=SyntaxWarning)  # rospy's on the missing queue
    # Without a queue rospy writes in the caller's thread, as the fastest of its users do.
    publishers = [rospy.Publisher(topic, TYPES[order["kind"]], queue_size=None, tcp_nodelay=True) for topic in order["topics"]]
    message = message_of(order["kind"], order["size_bytes"])
    protocol.send(order, [publisher.publish for publisher in publishers], message, stamp)


def receive(order: protocol.Order) -> None:
    """Subscribe to the ordered topics, and report how many messages came and how late."""
    meter = protocol.Meter(order["topics"])
    for topic in order["topics"]:
        rospy.Subscriber(topic, TYPES[order["kind"]], lambda message, topic=topic: meter.take(topic, stamp_of(message)), tcp_nodelay=True)
    protocol.receive(meter)


def serve(order: protocol.Order) -> None:
    """Serve a SetBool service until told to finish."""
    rospy.Service(order["topics"][0], SetBool, lambda request: SetBoolResponse(success=request.data, message="done"))
    protocol.report(event="ready")
    protocol.wait_for("finish")


def call(order: protocol.Order) -> None:
    """Call one behind the other."""
    rospy.wait_for_service(order["topics"][0], PROBE_S)
    proxy = rospy.ServiceProxy(order["topics"][0], SetBool, persistent=order["persistent"])
    protocol.call(order, lambda data: proxy(data).success)


def main() -> None:
    """Do what the order says."""
    order = protocol.read_order()
    rospy.init_node("bench_end", anonymous=True, disable_signals=True, disable_rostime=True)
    {"send": send, "receive": receive, "serve": serve, "call": call}[order["do"]](order)
    sys.stdout.flush()
    os._exit(0)  # rospy leaves threads that Python would wait for


main()
