"""The node on a live graph: what it lets through, and what it writes down when a fault begins and ends."""

from __future__ import annotations

import json
import select
from collections.abc import Iterator
from pathlib import Path

import pytest
import rospy
from radio_link.loop import NS, udp_socket
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String

from alula.common.network import free_port
from alula_testing.waits import until

NODE = Path(__file__).parents[1] / "scripts/radio_link_node"
STEP_NS = 10_000_000


class MissionTime:
    """A mission clock that goes on step by step, each when the radio is done with the one before."""

    def __init__(self) -> None:
        rospy.set_param("/use_sim_time", True)
        self.now_ns = 100 * NS
        self._done_ns = 0
        self._clock = rospy.Publisher("/clock", Clock, queue_size=100)
        self._done = rospy.Subscriber("/radio_link/done", Header, self._hear, queue_size=1)

    def _hear(self, done: Header) -> None:
        self._done_ns = done.stamp.to_nsec()

    def _step(self) -> None:
        self.now_ns += STEP_NS
        self._clock.publish(Clock(clock=rospy.Time(nsecs=self.now_ns)))

    def begin(self) -> None:
        """Go on until the radio is heard: what it says first may come before that."""
        until(lambda: self._step() or self._done_ns > 0, "the radio is up")

    def go_to(self, t_ns: int) -> None:
        while self.now_ns < t_ns:
            self._step()
            until(lambda: self._done_ns >= self.now_ns, f"the radio is done with {self.now_ns / NS} s")

    def close(self) -> None:
        self._clock.unregister()
        self._done.unregister()
        rospy.set_param("/use_sim_time", False)


@pytest.fixture
def mission_time(ros_master) -> Iterator[MissionTime]:
    time = MissionTime()
    yield time
    time.close()


def test_a_lost_control_link_takes_the_control_alone_and_is_written_down(mission_time, start_node, tmp_path):
    base = next(port for port in iter(free_port, None) if port < 60_000)
    log = tmp_path / "radio.jsonl"
    video, control, talker = udp_socket(base + 1), udp_socket(base + 5), udp_socket(0)
    start_node([str(NODE), f"_base_port:={base}", "_faults:=control@1-2", f"_log_path:={log}"])

    def told() -> list[bool]:
        return [json.loads(line)["control_lost"] for line in log.read_text().splitlines()] if log.exists() else []

    def passes() -> tuple[bool, bool]:
        """Whether video and control come through, both sent at the same time, within 0.3 s of mission clock."""
        for flow in (0, 4):
            talker.sendto(b"hello", ("127.0.0.1", base + flow))
        mission_time.go_to(mission_time.now_ns + 300_000_000)
        arrived = select.select([video, control], [], [], 0)[0]
        for each in arrived:
            each.recv(100)
        return video in arrived, control in arrived

    simulator = rospy.Publisher("/sim/state", String, queue_size=1, latch=True)
    mission_time.begin()
    assert passes() == (True, True)
    lift_off_ns = mission_time.now_ns
    simulator.publish(String(json.dumps({"lift_off_s": lift_off_ns / NS})))
    until(simulator.get_num_connections, "the radio hears the simulator")
    mission_time.go_to(lift_off_ns + NS - STEP_NS)
    assert told() == [False]
    mission_time.go_to(lift_off_ns + NS + STEP_NS)
    assert told() == [False, True]
    assert passes() == (True, False)
    mission_time.go_to(lift_off_ns + 2 * NS + STEP_NS)
    assert told() == [False, True, False]
    assert passes() == (True, True)
    begins_s, ends_s = (json.loads(line)["t_s"] for line in log.read_text().splitlines()[1:])
    assert (begins_s, ends_s) == pytest.approx((lift_off_ns / NS + 1.0, lift_off_ns / NS + 2.0), abs=2 * STEP_NS / NS)
    for each in (video, control, talker):
        each.close()


def test_every_flow_crosses_and_the_autopilots_answer_comes_back(ros_master, start_node):
    base = next(port for port in iter(free_port, None) if port < 60_000)
    listeners = {port: udp_socket(base + port) for port in (1, 3, 5, 8)}
    talker = udp_socket(0)
    start_node([str(NODE), f"_base_port:={base}"])

    def arrives(sender, to: int, at: int, data: bytes) -> tuple[str, int]:
        """Send until it arrives: the node opens its ports in its own time."""

        def comes() -> bool:
            sender.sendto(data, ("127.0.0.1", to))
            return bool(select.select([listeners[at]], [], [], 0.1)[0])

        until(comes, f"{data!r} at +{at}")
        got, source = listeners[at].recvfrom(100)
        assert got == data
        return source

    arrives(talker, base, 1, b"video")
    arrives(talker, base + 2, 3, b"report")
    autopilots_peer = arrives(talker, base + 4, 5, b"control")
    arrives(listeners[5], autopilots_peer[1], 8, b"telemetry")
    for each in (talker, *listeners.values()):
        each.close()
