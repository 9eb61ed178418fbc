"""Each kind of link carries again within two seconds of a network's return: the bridge here, rospy and roscpp on another computer.

A cut is silent: neither side gets an error. From its end on something is sent on each link, twenty times a second (calls and goals twice),
and the first that arrives ends its time. Before, the busy links have carried all the while, and the idle ones nothing.
"""

import os
import signal
import socket
import time
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit
from xmlrpc.client import ServerProxy

import pytest
from ros_bridge_action_nodes import ActionNode, Sent
from ros_bridge_harness import end
from ros_bridge_networked import RELAY, BaseComputer, Links, all_carry_again, times_until_all_arrive
from ros_bridge_nodes import Ros2Peer

from alula_testing.networks import Network
from alula_testing.waits import until

CONFIG = """
topics:
  - {name: /net/brief, direction: ros2_to_ros1, type: std_msgs/String}
  - {name: /net/up, direction: ros1_to_ros2, type: std_msgs/String}
  - {name: /net/busy_up, direction: ros1_to_ros2, type: std_msgs/String}
  - {name: /net/down, direction: ros2_to_ros1, type: std_msgs/String}
  - {name: /net/busy_down, direction: ros2_to_ros1, type: std_msgs/String}
  - {name: /net/relay_in, direction: ros2_to_ros1, type: std_msgs/String}
  - {name: /net/relay_out, direction: ros1_to_ros2, type: std_msgs/String}
services:
  - {name: /net/in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 3.0}
  - {name: /net/in_ros2, server: ros2, type: std_srvs/SetBool, timeout_s: 3.0}
actions:
  - {name: /net/count, server: ros1, type: bridge_test_interfaces/Count}
"""
AGAIN_WITHIN_S = 2.0
SLOWLY_S = 1.5
"""What a busy machine may add: the bound tells a link that carries again from one that is tried again later and later."""


@pytest.fixture(scope="module")
def base(ros2_domain):
    with Network() as network:
        base = BaseComputer(network)
        yield base
        base.close()


@pytest.fixture(scope="module")
def bridge(base, tmp_path_factory):
    bridge = base.bridge(tmp_path_factory.mktemp("networks"), CONFIG)
    yield bridge
    bridge.close()


@pytest.fixture(scope="module")
def links(base, bridge):
    ros2 = Ros2Peer()
    yield Links(base, ros2)
    ros2.tidy()
    ros2.close()


@pytest.fixture(scope="module")
def actions(bridge):
    node = ActionNode()
    node.thread.start()
    yield node
    node.close()


@pytest.fixture(scope="module")
def probes(base, links, actions):
    """One for each kind of link, all of which have carried once."""
    probes = {
        "idle topic to ROS 2": links.up("/net/up"),
        "busy topic to ROS 2": links.up("/net/busy_up"),
        "idle topic to ROS 1": links.down("/net/down"),
        "busy topic to ROS 1": links.down("/net/busy_down"),
        "service in ROS 1": links.in_ros1("/net/in_ros1"),
        "service in ROS 2": links.in_ros2("/net/in_ros2"),
    }
    server = base.peer("ros_bridge_action_peer.py")
    client = actions.client("/net/count")
    probes["action in ROS 1"] = links.action("/net/count", lambda **fields: Sent(client, **fields), server)
    base.run(str(RELAY), "/net/relay_in", "/net/relay_out")
    probes["roscpp, idle"] = links.round_trip("/net/relay_in", "/net/relay_out")
    times_until_all_arrive(probes)
    return probes


def busy(probes):
    return [probe for name, probe in probes.items() if "busy" in name]


def carry_on(probes, seconds):
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        for probe in busy(probes):
            probe.step(time.monotonic())
        time.sleep(0.01)


def connections(peer, topic):
    peer.do("connections", topic=topic)
    return peer.expect("connections", topic=topic)["number"]


def all_carry(disturb, probes):
    all_carry_again(disturb, probes, AGAIN_WITHIN_S + SLOWLY_S)


@pytest.mark.parametrize("seconds", [0.5, 7.0, pytest.param(15.0, marks=pytest.mark.long)])
def test_every_link_carries_again_after_a_cut(base, probes, seconds):
    def disturb():
        with base.cut():
            carry_on(probes, seconds)

    all_carry(disturb, probes)


ESTABLISHED, FIN_WAIT1 = "01", "04"  # proc(5): net/tcp
LOOKS = 10
"""A connection that is reset is seen in no look after its end, one that is ended in order in 33 on a busy machine, in more on another."""


def waits_to_be_sent(address, port):
    """Return the states of this computer's connections to that place that have bytes which were not acknowledged.

    Begin and end of a connection count one each.
    """
    place = f"{int.from_bytes(socket.inet_aton(address), 'little'):08X}:{port:04X}"
    rows = (line.split() for line in Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:])
    return [row[3] for row in rows if row[2] == place and int(row[4].partition(":")[0], 16) > 1]


def test_call_that_was_given_up_in_a_cut_is_not_sent_again_after_it(base, probes):
    calls = {"service in ROS 1": probes["service in ROS 1"]}
    times_until_all_arrive(calls)  # a connection is there
    uri = ServerProxy(base.uri).lookupService("/bridge_test", "/net/in_ros1")[2]
    place = base.computer.address, urlsplit(uri).port
    seen = []
    with base.cut():
        (call,) = calls.values()
        call.next_s = 0.0
        call.step(time.monotonic())
        until(lambda: waits_to_be_sent(*place) == [ESTABLISHED], "the request is on its way")
        until(lambda: not (seen.append(waits_to_be_sent(*place)) or seen[-1]), "it is dropped at its timeout, 3 s")
    assert sum(FIN_WAIT1 in states for states in seen) < LOOKS, "it was ended in order, and waited to be sent again"
    times_until_all_arrive(calls)


@pytest.mark.parametrize("there", [True, False])
def test_every_link_carries_again_after_a_cut_of_one_direction(base, probes, there):
    def disturb():
        with base.cut(one_way=True) if there else base.network.cut(base.here, base.computer, one_way=True):
            carry_on(probes, 5.0)

    all_carry(disturb, probes)


def test_subscriber_whose_end_is_gone_is_asked_to_connect_again(base, links):
    """Of its connections rospy itself ends those whose peer is away for long, and does not connect again."""
    peer = base.peer()
    peer.do("keep_alive_briefly")
    probe = links.down("/net/brief", peer=peer)
    times_until_all_arrive({"down": probe})

    def disturb():
        with base.cut():
            until(lambda: connections(peer, "/net/brief") == 0, "rospy has given the connection up")

    all_carry(disturb, {"down": probe})


def test_every_link_carries_again_when_bridge_or_peer_slept_through_a_cut(base, bridge, links, probes):
    def disturb(process):
        with base.cut():
            carry_on(probes, 1.0)
            os.kill(process.pid, signal.SIGSTOP)
            time.sleep(4.0)
        os.kill(process.pid, signal.SIGCONT)

    for process in (bridge.process, links.peer.process):
        all_carry(partial(disturb, process), probes)


def test_goal_under_way_survives_a_cut(base, probes, actions):
    """Its result comes although it was sent into the cut."""
    sent = Sent(actions.client("/net/count"), target=30, period_s=0.1, behaviour="count")
    sent.accepted()
    with base.cut():
        time.sleep(5.0)
    assert sent.result().result.message == "from ROS 1"


def test_every_link_carries_when_the_master_was_restarted_in_a_cut(base, probes):
    """Nothing of this depends on the master, and rospy never tells a restarted one of itself."""

    def disturb():
        with base.cut():
            end(base.master)
            carry_on(probes, 4.0)
            base.start_master()
        base.wait_for_master()

    all_carry(disturb, {name: probe for name, probe in probes.items() if "service" not in name})
