"""A ROS 1 node for the bridge's tests, in a process of the ROS 1 world: takes commands as JSON lines, reports events as JSON lines."""

import json
import os
import sys
import threading
from collections import Counter
from io import BytesIO

import rosbag
import roslib.message
import rospy
from genpy.message import fill_message_args

WRITE = threading.Lock()
KEEP = []
BAG = []


def report(**event):
    with WRITE:
        sys.stdout.write(json.dumps(event) + "\n")
        sys.stdout.flush()


def serialized(message):
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue().hex()


def filled(message, values):
    fill_message_args(message, [values])
    return message


def subscribe(topic, type):  # noqa: A002
    message_class = roslib.message.get_message_class(type)

    def received(message):
        report(event="message", topic=topic, hex=serialized(message), latched=message._connection_header.get("latching") == "1")

    KEEP.append(rospy.Subscriber(topic, message_class, received))


PUBLISHERS = {}


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
        report(event="message", topic=topic, hex=message._buff.hex(), caller=message._connection_header["callerid"])

    KEEP.append(rospy.Subscriber(topic, rospy.AnyMsg, received))


def publish_once(topic, type, values):  # noqa: A002
    """Wait for a subscriber as short-lived publishers do, publish one message, and leave for good."""
    advertise(topic, type)
    while not PUBLISHERS[topic].get_num_connections():
        rospy.rostime.wallsleep(0.01)
    publish(topic, values)
    rospy.rostime.wallsleep(0.2)  # what rospy has in its queue would be lost
    os._exit(0)


def set_parameter(name, value):
    rospy.set_param(name, value)
    report(event="set", name=name)


def recorded(path, number):
    """Yield topic, type, MD5 sum, definition and bytes of each connection's first messages."""
    counts = Counter()
    with rosbag.Bag(path) as bag:
        for topic, (kind, data, md5sum, *_, message_class), _time in bag.read_messages(raw=True):
            counts[topic] += 1
            if counts[topic] <= number:
                yield topic, kind, md5sum, message_class._full_text, data


def advertise_bag(path, prefix, number):
    """Advertise what a recording has, with the recorded types."""
    for topic, kind, md5sum, text, data in recorded(path, number):
        name = prefix + topic
        if name not in PUBLISHERS:
            fields = {"__slots__": (), "_type": kind, "_md5sum": md5sum, "_full_text": text, "_has_header": False}
            PUBLISHERS[name] = rospy.Publisher(name, type(f"Recorded{len(PUBLISHERS)}", (rospy.AnyMsg,), fields), queue_size=1000)
        BAG.append((name, data))
    report(event="advertised")


def play_bag():
    """Publish it, not faster than queues can take it."""
    for name, data in BAG:
        message = PUBLISHERS[name].data_class()
        message._buff = data
        PUBLISHERS[name].publish(message)
        rospy.rostime.wallsleep(0.002)
    report(event="played", number=len(BAG))


def connections(topic):
    report(event="connections", topic=topic, number=PUBLISHERS[topic].get_num_connections())


def serve(service, type, behaviour, seconds=0.0):  # noqa: A002
    """Behaviours: echo, raise, slow, die."""
    service_class = roslib.message.get_service_class(type)

    def handle(request):
        report(event="request", service=service, hex=serialized(request))
        if behaviour == "raise":
            raise ValueError("the handler is broken")
        if behaviour == "die":
            os._exit(1)
        threading.Event().wait(seconds)
        return filled(service_class._response_class(), {"success": request.data, "message": "from ROS 1"})

    KEEP.append(rospy.Service(service, service_class, handle))


def call(service, type, values):  # noqa: A002
    service_class = roslib.message.get_service_class(type)

    def run():
        rospy.wait_for_service(service, 10.0)
        try:
            response = rospy.ServiceProxy(service, service_class)(filled(service_class._request_class(), values))
        except rospy.ServiceException as error:
            report(event="call_failed", service=service, reason=str(error))
        else:
            report(event="called", service=service, text=str(response))

    threading.Thread(target=run, daemon=True).start()


COMMANDS = {
    "subscribe": subscribe,
    "advertise": advertise,
    "publish": publish,
    "subscribe_raw": subscribe_raw,
    "publish_once": publish_once,
    "set_parameter": set_parameter,
    "advertise_bag": advertise_bag,
    "play_bag": play_bag,
    "connections": connections,
    "serve": serve,
    "call": call,
}


def main():
    rospy.init_node("bridge_test_peer", anonymous=True, disable_signals=True, disable_rostime=True)
    report(event="ready")
    for line in sys.stdin:
        command = json.loads(line)
        COMMANDS[command.pop("do")](**command)
    os._exit(0)


main()
