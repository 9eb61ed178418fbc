"""A ROS 1 node for the bridge's tests, in a process of the ROS 1 world: takes commands as JSON lines, reports events as JSON lines."""

import os
import socket
import threading
import warnings
from collections import deque
from hashlib import md5
from io import BytesIO

import rosbag
import roslib.message
import rospy
from genpy.message import fill_message_args
from ros_bridge_peer_loop import report, run

KEEP = []
LET_GO = threading.Event()


def serialized(message):
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue().hex()


def filled(message, values):
    fill_message_args(message, [values])
    return message


def keep_alive_briefly():
    """Have this node's ends of connections end after three seconds without an answer, not after rospy's 150."""
    brief = {socket.TCP_KEEPIDLE: 1, socket.TCP_KEEPINTVL: 1, socket.TCP_KEEPCNT: 2}
    plain = socket.socket.setsockopt

    def set_option(self, level, option, value):
        plain(self, level, option, brief.get(option, value) if level == socket.SOL_TCP else value)

    socket.socket.setsockopt = set_option


def subscribe(topic, type):  # noqa: A002
    message_class = roslib.message.get_message_class(type)

    def received(message):
        report(event="message", topic=topic, hex=serialized(message), latched=message._connection_header.get("latching") == "1")

    SUBSCRIBERS[topic] = rospy.Subscriber(topic, message_class, received)


PUBLISHERS = {}
SUBSCRIBERS = {}
BAG = deque()


def advertise(topic, type, *, latch=False):  # noqa: A002
    PUBLISHERS[topic] = rospy.Publisher(topic, roslib.message.get_message_class(type), latch=latch, queue_size=100)


def publish(topic, values):
    publisher = PUBLISHERS[topic]
    message = filled(publisher.data_class(), values)
    publisher.publish(message)
    report(event="published", topic=topic, hex=serialized(message))


def subscribe_raw(topic):
    """Subscribe with no type of its own, as `rostopic echo` does."""

    def received(message):
        header = message._connection_header
        report(event="message", topic=topic, hex=message._buff.hex(), caller=header["callerid"], type=header["type"])

    KEEP.append(rospy.Subscriber(topic, rospy.AnyMsg, received))


class Subscribed(rospy.SubscribeListener):
    """Tells when a subscriber has connected."""

    def __init__(self):
        super().__init__()
        self.event = threading.Event()

    def peer_subscribe(self, *_):
        self.event.set()


def publish_once(topic, type, values):  # noqa: A002
    """Wait for a subscriber as short-lived publishers do, publish one message, and leave for good."""
    subscribed = Subscribed()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)  # rospy's, about what is meant here: without a queue the message is sent at once
        PUBLISHERS[topic] = rospy.Publisher(topic, roslib.message.get_message_class(type), subscribed, queue_size=None)
    subscribed.event.wait()
    publish(topic, values)
    os._exit(0)


def set_parameter(name, value):
    rospy.set_param(name, value)
    report(event="set", name=name)


def bytes_class(kind, md5sum, definition):
    """Return a class of messages that are serialized already, of a type that need not be installed."""
    fields = {"__slots__": (), "_type": kind, "_md5sum": md5sum, "_full_text": definition, "_has_header": False}
    return type(kind.replace("/", "_"), (rospy.AnyMsg,), fields)


def advertise_own(topic, type, definition):  # noqa: A002
    """Advertise a type of which only this node has the definition."""
    md5sum = md5(definition.strip().encode()).hexdigest()  # noqa: S324 - ROS 1's fingerprint
    PUBLISHERS[topic] = rospy.Publisher(topic, bytes_class(type, md5sum, definition), queue_size=1)


def subscribe_own(topic, type, definition):  # noqa: A002
    """Subscribe with a type of which only this node has the definition."""
    md5sum = md5(definition.strip().encode()).hexdigest()  # noqa: S324 - ROS 1's fingerprint

    def received(message):
        report(event="message", topic=topic, hex=message._buff.hex())

    KEEP.append(rospy.Subscriber(topic, bytes_class(type, md5sum, definition), received))


def publish_bytes(topic, hex):  # noqa: A002
    """Publish a message of such a type."""
    message = PUBLISHERS[topic].data_class()
    message._buff = bytes.fromhex(hex)
    PUBLISHERS[topic].publish(message)


def advertise_bag(path, prefix):
    """Advertise what a recording has, with the recorded types."""
    with rosbag.Bag(path) as bag:
        recorded = [(prefix + topic, raw) for topic, raw, _ in bag.read_messages(raw=True)]
    for topic, (kind, _, md5sum, *_, message_class) in recorded:
        if topic not in PUBLISHERS:
            PUBLISHERS[topic] = rospy.Publisher(topic, bytes_class(kind, md5sum, message_class._full_text), queue_size=1000)
    BAG.extend((topic, raw[1]) for topic, raw in recorded)
    report(event="advertised", number=len(recorded))


def play(number):
    """Publish the next messages of the recording, in its order."""
    for _ in range(min(number, len(BAG))):
        topic, data = BAG.popleft()
        message = PUBLISHERS[topic].data_class()
        message._buff = data
        PUBLISHERS[topic].publish(message)


def connections(topic):
    report(event="connections", topic=topic, number=(PUBLISHERS | SUBSCRIBERS)[topic].get_num_connections())


def serve(service, type, behaviour, seconds=0.0):  # noqa: A002
    """Behaviours: echo, raise, slow (by ``seconds``), held (until ``let_go``), die."""
    service_class = roslib.message.get_service_class(type)

    def handle(request):
        report(event="request", service=service, hex=serialized(request))
        if behaviour == "raise":
            raise ValueError("the handler is broken")
        if behaviour == "die":
            os._exit(1)
        if behaviour == "held":
            LET_GO.wait()
        threading.Event().wait(seconds)
        return filled(service_class._response_class(), {"success": request.data, "message": "from ROS 1"})

    KEEP.append(rospy.Service(service, service_class, handle))


def call(service, type, values):  # noqa: A002
    service_class = roslib.message.get_service_class(type)

    def run():
        rospy.wait_for_service(service)
        try:
            response = rospy.ServiceProxy(service, service_class)(filled(service_class._request_class(), values))
        except rospy.ServiceException as error:
            report(event="call_failed", service=service, reason=str(error))
        else:
            report(event="called", service=service, text=str(response))

    threading.Thread(target=run, daemon=True).start()


COMMANDS = {
    "keep_alive_briefly": keep_alive_briefly,
    "subscribe": subscribe,
    "advertise": advertise,
    "publish": publish,
    "subscribe_raw": subscribe_raw,
    "publish_once": publish_once,
    "set_parameter": set_parameter,
    "advertise_own": advertise_own,
    "subscribe_own": subscribe_own,
    "publish_bytes": publish_bytes,
    "advertise_bag": advertise_bag,
    "play": play,
    "connections": connections,
    "serve": serve,
    "let_go": LET_GO.set,
    "call": call,
}


run("bridge_test_peer", COMMANDS)
