"""A ROS 1 node for the bridge's tests, in a process of the ROS 1 world: takes commands as JSON lines, reports events as JSON lines."""

import json
import os
import sys
import threading
from io import BytesIO

import roslib.message
import rospy
from genpy.message import fill_message_args

WRITE = threading.Lock()
KEEP = []


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
