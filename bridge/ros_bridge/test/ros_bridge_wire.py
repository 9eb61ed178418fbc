"""TCPROS by hand for the bridge's tests: frames, connection headers, publishers that answer with given bytes."""

import socket
import struct
import threading

from ros_bridge_harness import PROBE_S
from std_msgs.msg import String

from bridge_tools.hostile import LENGTH, HostilePublisher
from ros_bridge.tcpros import decode_header, encode_header

STRING_SUM = "992ce8a1687cec8c8bd883ec73ca41d1"


def header(**fields):
    return encode_header(fields)


def read_header(connection):
    return decode_header(read_frame(connection))


def read_frame(connection):
    return exactly(connection, LENGTH.unpack(exactly(connection, 4))[0])


def exactly(connection, size):
    data = b""
    while len(data) < size:
        part = connection.recv(size - len(data))
        assert part, "the connection was closed"
        data += part
    return data


def frame(text):
    """Return a std_msgs/String as it goes over a connection."""
    body = text.encode()
    return struct.pack("<II", len(body) + 4, len(body)) + body


def greeting(topic):
    """Return the header that a publisher of std_msgs/String answers with."""
    return header(callerid="/fake", type="std_msgs/String", md5sum=STRING_SUM, latching="0", topic=topic)


def wish(**changed):
    """Return the header that a subscriber of std_msgs/String asks with."""
    return header(**{"callerid": "/t", "topic": "/bp/down", "type": "std_msgs/String", "md5sum": STRING_SUM} | changed)


def until_it_arrives(publisher, connection, text):
    """Publish until it comes out of a raw connection; what came before is passed over."""
    stop = threading.Event()

    def publish():
        while not stop.wait(PROBE_S):
            publisher.publish(String(data=text))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        while read_frame(connection)[4:] != text.encode():
            pass
    finally:
        stop.set()
        thread.join()


class FakePublisher(HostilePublisher):
    """A ROS 1 publisher that answers each connection with the next of given bytes, or the last, and closes it."""

    def __init__(self, master, replies, topic="/bp/fake", type_name="std_msgs/String"):
        self.replies = list(replies)
        self.answered = 0
        super().__init__(master.uri, topic, type_name, name="/fake", reply=b"", talk=self._answer)

    def _answer(self, connection):
        connection.sendall(self.replies[min(self.answered, len(self.replies) - 1)])
        self.answered += 1
        connection.shutdown(socket.SHUT_WR)
        connection.recv(1)
