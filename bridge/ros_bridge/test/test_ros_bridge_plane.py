"""The native data plane among peers of every kind: latching ones, those that break off, those that speak no TCPROS, or too much of it."""

import itertools
import json
import os
import random
import signal
import socket
import struct
import sys
import threading
from xmlrpc.client import ServerProxy

from ros_bridge_harness import HERE, PROBE_S, Lines, Ros1Peer
from ros_bridge_nodes import LATCHED
from ros_bridge_wire import STRING_SUM, FakePublisher, frame, greeting, read_frame, read_header, until_it_arrives, wish
from std_msgs.msg import String

from alula_testing.waits import HANGS_S, until

CONFIG = """
topics:
  - {name: /bp/up, direction: ros1_to_ros2, type: std_msgs/String, depth: 100}
  - {name: /bp/down, direction: ros2_to_ros1, type: std_msgs/String, depth: 100}
  - {name: /bp/up_latched, direction: ros1_to_ros2, type: std_msgs/String, latched: true, depth: 1}
  - {name: /bp/down_latched, direction: ros2_to_ros1, type: std_msgs/String, latched: true, depth: 1}
  - {name: /bp/flood, direction: ros1_to_ros2, type: std_msgs/String, depth: 10}
  - {name: /bp/burst, direction: ros1_to_ros2, type: std_msgs/String, depth: 100}
  - {name: /bp/stopped, direction: ros1_to_ros2, type: std_msgs/String}
  - {name: /bp/stalled, direction: ros1_to_ros2, type: std_msgs/String}
  - {name: /bp/fake, direction: ros1_to_ros2, type: std_msgs/String, depth: 100}
  - {ros1_name: /bp/fake, ros2_name: /bp/fake_too, direction: ros1_to_ros2, type: std_msgs/String, depth: 100}
"""


def texts(ros2, topic, qos=100):
    received = []
    ros2.listen(topic, String, lambda message: received.append(message.data), qos)
    return received


def place_in_ros1(master, topic):
    """Ask the bridge's node where it sends a topic from, as a subscriber does."""
    proxy = ServerProxy(master.uri)
    publishers = dict(proxy.getSystemState("/plane_test")[2][0])[topic]
    assert publishers == ["/ros_bridge"]
    uri = proxy.lookupNode("/plane_test", publishers[0])[2]
    code, _, (kind, host, port) = ServerProxy(uri).requestTopic("/plane_test", topic, [["TCPROS"]])
    assert (code, kind) == (1, "TCPROS")
    return host, port


def test_each_latching_publisher_in_ros1_keeps_its_message_for_late_joiners(ros2, master, bridge):
    peers = {text: Ros1Peer(master) for text in ("left", "right", "top")}
    early = texts(ros2, "/bp/up_latched", LATCHED)
    for text, peer in peers.items():
        peer.do("advertise", topic="/bp/up_latched", type="std_msgs/String", latch=True)
        peer.do("publish", topic="/bp/up_latched", values={"data": "old " + text})
        peer.do("publish", topic="/bp/up_latched", values={"data": text})
    until(lambda: set(peers) <= set(early), f"all have crossed: {early}")
    late = texts(ros2, "/bp/up_latched", LATCHED)
    until(lambda: set(late) == set(peers), f"a late joiner gets all of them: {late}")
    assert len(late) == 3


def test_each_transient_local_publisher_in_ros2_keeps_its_message_for_late_joiners(ros2, master, bridge):
    wanted = {(struct.pack("<I", len(text)) + text.encode()).hex() for text in ("left", "right")}
    publishers = [ros2.publisher("/bp/down_latched", String, LATCHED) for _ in range(2)]
    publishers[0].publish(String(data="old"))
    for publisher, text in zip(publishers, ("left", "right"), strict=True):
        publisher.publish(String(data=text))
    first = Ros1Peer(master)
    first.do("subscribe", topic="/bp/down_latched", type="std_msgs/String")
    seen = set()
    while not wanted <= seen:
        seen.add(first.expect("message", topic="/bp/down_latched")["hex"])
    late = Ros1Peer(master)
    late.do("subscribe", topic="/bp/down_latched", type="std_msgs/String")
    assert {late.expect("message", topic="/bp/down_latched")["hex"] for _ in wanted} == wanted


def test_large_and_small_messages_keep_their_order_both_ways(ros2, master, bridge):
    received = texts(ros2, "/bp/up")
    publisher = ros2.publisher("/bp/down", String)
    peer = Ros1Peer(master)
    peer.do("advertise", topic="/bp/up", type="std_msgs/String")

    def arrives():
        peer.do("publish", topic="/bp/up", values={"data": "probe"})
        return received

    until(arrives, "the first message arrives", every_s=PROBE_S)
    sent = [f"{number:03}" + "x" * (number % 3 * 200_000) for number in range(30)]
    for text in sent:
        peer.do("publish", topic="/bp/up", values={"data": text})
    until(lambda: received[-1] == sent[-1], "the last arrives")
    assert [text for text in received if text != "probe"] == sent
    place = place_in_ros1(master, "/bp/down")
    with socket.create_connection(place, HANGS_S) as connection:
        connection.sendall(wish(type="*", md5sum="*"))
        read_header(connection)
        until_it_arrives(publisher, connection, "probe")
        for text in sent:
            publisher.publish(String(data=text))
            while (body := read_frame(connection)[4:]) == b"probe":
                pass
            assert body.decode() == text


def test_subscribers_are_checked_and_answered(ros2, master, bridge):
    place = place_in_ros1(master, "/bp/down")
    publisher = ros2.publisher("/bp/down", String, 10)
    for wrong, words in [
        ({"md5sum": "0" * 32}, "md5sum"),
        ({"type": "std_msgs/Int32"}, "std_msgs/Int32"),
        ({"topic": "/bp/nothing"}, "/bp/nothing"),
    ]:
        with socket.create_connection(place, HANGS_S) as connection:
            connection.sendall(wish(**wrong))
            assert words in read_header(connection)["error"]
            assert connection.recv(1) == b""
    for accepted in ({}, {"type": "*", "md5sum": "*"}):
        with socket.create_connection(place, HANGS_S) as connection:
            connection.sendall(wish(**accepted))
            answer = read_header(connection)
            assert (answer["type"], answer["md5sum"], answer["latching"]) == ("std_msgs/String", STRING_SUM, "0")
            assert answer["callerid"] == "/ros_bridge"
            assert "string data" in answer["message_definition"]
            until_it_arrives(publisher, connection, "for a subscriber that fits")


def test_garbage_on_the_listening_socket_harms_no_subscriber(ros2, master, bridge):
    place = place_in_ros1(master, "/bp/down")
    publisher = ros2.publisher("/bp/down", String, 10)
    chance = random.Random(7)  # noqa: S311
    whole = wish()
    with socket.create_connection(place, HANGS_S) as bystander:
        bystander.sendall(whole)
        read_header(bystander)
        for number in range(200):
            garbage = bytearray(whole)
            for _ in range(chance.randrange(1, 4)):
                garbage[chance.randrange(len(garbage))] = chance.randrange(256)
            kind = number % 4
            data = [bytes(garbage), whole[: chance.randrange(len(whole))], chance.randbytes(300), whole + chance.randbytes(5000)][kind]
            with socket.create_connection(place, HANGS_S) as connection:
                connection.sendall(data)
        until_it_arrives(publisher, bystander, "still here")
    assert bridge.process.poll() is None


def test_publisher_that_breaks_off_or_talks_nonsense_is_tried_again_and_harms_no_subscriber(ros2, master, bridge):
    """Two routes lead from the topic, so each reply goes to two connections; all of them are tried again until the good message comes."""
    received, too = texts(ros2, "/bp/fake"), texts(ros2, "/bp/fake_too")
    hello = greeting("/bp/fake")
    replies = [
        b"",
        hello[:20],
        b"\xff" * 400,
        hello + struct.pack("<I", 4_000_000) + b"x" * 2_000_000,  # killed in the middle of a 4 MB message
        hello + struct.pack("<I", 0xFFFFFFF0) + b"x" * 1000,
        hello + struct.pack("<II", 4, 0xFFFFFFFF) + frame("behind nonsense"),
        hello + frame("good") * 3,
    ]
    # A reply that does not fit makes the bridge wait 5 s, and that is not what is tested: each such reply has a publisher of its own.
    for index, reply in enumerate(replies):
        fake = FakePublisher(master, [reply])
        until(lambda fake=fake: fake.answered >= 2, f"both routes connect for reply {index}")
        if index >= 5:
            words = "good" if index == 6 else "behind nonsense"
            until(lambda words=words: words in received and words in too, f"'{words}' arrives on both")
        fake.close()
    assert {"good", "behind nonsense"} == set(received) == set(too)
    figures = {}

    def counted():
        figures.update(json.loads(bridge.stats_file.read_text())["topics"]) if bridge.stats_file.is_file() else None
        return figures.get("/bp/fake", {}).get("errors", 0) >= 1

    until(counted, "the message that is none is counted")
    beats = ros2.subscribe("/ros_bridge/state", String, LATCHED)
    until(lambda: beats and json.loads(beats[-1].data)["errors"] >= 1, "the heartbeat tells of it")


def test_lost_publisher_is_found_again(ros2, master, bridge):
    received = texts(ros2, "/bp/fake")
    hello = greeting("/bp/fake")
    fake = FakePublisher(master, [b"", b"", b"", hello + frame("again")])
    until(lambda: "again" in received, "it is tried again")
    fake.close()


def test_burst_goes_out_as_fast_as_subscribers_keep_up_and_none_of_it_is_lost(ros2, master, bridge):
    """900 messages at once: a subscriber with ROS 2's usual queue of 10 would lose most of them if they came at once.

    How fast they went out is read from DDS's time stamps, so it does not matter when this process is scheduled.
    """
    received: list[tuple[str, int]] = []
    ros2.listen("/bp/burst", String, lambda message, info: received.append((message.data, info["source_timestamp"])), 2000)
    hello = greeting("/bp/burst")
    probe = FakePublisher(master, [hello + frame("(probe)")], "/bp/burst")
    until(lambda: received, "a probe arrives: the ends in ROS 2 know each other")
    probe.close()
    sent = [f"{number:03}" for number in range(900)]
    fake = FakePublisher(master, [hello + b"".join(frame(text) for text in sent), hello], "/bp/burst")
    until(lambda: received[-1][0] == sent[-1], "the last one arrives")
    fake.close()
    burst = [(text, stamp_ns) for text, stamp_ns in received if text != "(probe)"]
    assert [text for text, _ in burst] == sent
    stamps_ms = [(stamp_ns - burst[0][1]) / 1e6 for _, stamp_ns in burst]
    early_ms = [stamp_ms for stamp_ms in stamps_ms if stamp_ms < 90]  # one that lasts for 100 ms goes out faster
    assert max(sum(begin <= stamp < begin + 5 for stamp in stamps_ms) for begin in early_ms) <= 5 + 2 * 5 + 1


def test_subscriber_whose_process_stands_still_gets_the_whole_burst_afterwards(ros2, master, bridge):
    """While its process is stopped, more messages come than DDS's shared-memory queue holds (512): the writer has to keep the rest.

    The writer's numbers tell the hop that loses: those that the second subscriber got have all left the writer.
    """
    sent = [f"{number:03}" for number in range(900)]
    beside = texts(ros2, "/bp/stopped", 2000)
    peer = Lines([sys.executable, str(HERE / "ros_bridge_counting_peer.py"), "/bp/stopped", "2000"], dict(os.environ), errors=False)
    hello = greeting("/bp/stopped")
    probe = FakePublisher(master, [hello + frame("(probe)")], "/bp/stopped")
    until(lambda: beside and peer.lines, "a probe arrives at both")
    probe.close()
    os.kill(peer.process.pid, signal.SIGSTOP)
    try:
        fake = FakePublisher(master, [hello + b"".join(frame(text) for text in sent), hello], "/bp/stopped")
        until(lambda: beside[-1] == sent[-1], "all have left the bridge")
        fake.close()
    finally:
        os.kill(peer.process.pid, signal.SIGCONT)

    def came():
        return [(text, number) for text, number in map(json.loads, list(peer.lines)) if text != "(probe)"]

    until(lambda: came() and came()[-1][0] == sent[-1], "the last one arrives")
    numbers = [number for _, number in came()]
    gaps = [(before, after) for before, after in itertools.pairwise(numbers) if after != before + 1]
    assert [text for text, _ in came()] == sent, f"lost behind the writer, between its numbers {gaps}"
    assert [text for text in beside if text != "(probe)"] == sent


def test_subscriber_that_stalls_loses_what_its_own_queue_has_no_room_for_as_within_ros2(ros2, master, bridge):
    """A reader acknowledges what it will drop: no writer can tell, the bridge's no more than one of ROS 2. Room in its queue helps."""
    sent = [f"{number:02}" for number in range(90)]
    within = ros2.node.create_publisher(String, "/bp/stalled_within", 1000)
    ros2.ends.append((ros2.node.destroy_publisher, within))
    short, roomy = (texts(ros2, "/bp/stalled", depth) for depth in (10, 200))
    short_within, roomy_within = (texts(ros2, "/bp/stalled_within", depth) for depth in (10, 200))
    peer = Lines([sys.executable, str(HERE / "ros_bridge_counting_peer.py"), "/bp/stalled", "200"], dict(os.environ), errors=False)
    hello = greeting("/bp/stalled")
    probe = FakePublisher(master, [hello + frame("(probe)")], "/bp/stalled")
    until(lambda: peer.lines and short and roomy and within.get_subscription_count() == 2, "all know each other")
    probe.close()
    go_on = threading.Event()
    ros2.executor.create_task(go_on.wait, HANGS_S)
    ros2.executor.wake()
    try:
        fake = FakePublisher(master, [hello + b"".join(frame(text) for text in sent), hello], "/bp/stalled")
        for text in sent:
            within.publish(String(data=text))
        until(lambda: json.loads(list(peer.lines)[-1])[0] == sent[-1], "all have left the bridge")
        fake.close()
    finally:
        go_on.set()
    for heard in (short, roomy, short_within, roomy_within):
        until(lambda heard=heard: heard[-1:] == sent[-1:], "the last one arrives")
    for heard in (short, short_within):
        assert len(set(heard) & set(sent)) < len(sent)
    for heard in (roomy, roomy_within):
        assert [text for text in heard if text != "(probe)"] == sent


def test_flood_crosses_in_order_and_what_has_to_go_is_counted(ros2, master, bridge):
    """20000 messages at once on a route of depth 10: the newest get through, and each is either counted as crossed or as dropped."""
    received = texts(ros2, "/bp/flood", 20_000)
    hello = greeting("/bp/flood")
    probe = FakePublisher(master, [hello + frame("(probe)")], "/bp/flood")
    until(lambda: received, "a probe arrives: the ends in ROS 2 know each other")
    probe.close()
    fake = FakePublisher(master, [hello + b"".join(frame(f"{number:05}") for number in range(20_000)), hello], "/bp/flood")
    until(lambda: received[-1] == "19999", "the last one arrives")
    assert received == sorted(received)
    figures = {}
    sent = 20_000 + probe.answered

    def counted():
        figures.update(json.loads(bridge.stats_file.read_text())["topics"]["/bp/flood"])
        return figures["count"] + figures["dropped"] >= sent

    until(counted, f"all are counted: {figures}")
    assert figures["count"] + figures["dropped"] == sent
    assert len(received) <= figures["count"]
    fake.close()
