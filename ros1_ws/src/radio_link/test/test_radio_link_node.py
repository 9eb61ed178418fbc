"""The node on a live graph: what it lets through, and what it writes down when a fault begins and ends."""

from __future__ import annotations

import json
import select
from pathlib import Path

import rospy
from radio_link.loop import udp_socket
from std_msgs.msg import String

from alula.common.network import free_port
from alula_testing.waits import until

NODE = Path(__file__).parents[1] / "scripts/radio_link_node"
TIMEOUT_S = 30.0


def test_a_lost_control_link_takes_the_control_alone_and_is_written_down(ros_master, start_node, tmp_path):
    base = next(port for port in iter(free_port, None) if port < 60_000)
    log = tmp_path / "radio.jsonl"
    video, control, talker = udp_socket(base + 1), udp_socket(base + 5), udp_socket(0)
    start_node([str(NODE), f"_base_port:={base}", "_faults:=control@1-2", f"_log_path:={log}"])

    def told() -> list[bool]:
        return [json.loads(line)["control_lost"] for line in log.read_text().splitlines()] if log.exists() else []

    def passes() -> tuple[bool, bool]:
        """Whether video and control come through, both sent at the same time."""
        for flow in (0, 4):
            talker.sendto(b"hello", ("127.0.0.1", base + flow))
        arrived = select.select([video], [], [], 1.0)[0] + select.select([control], [], [], 0.1)[0]
        for each in arrived:
            each.recv(100)
        return video in arrived, control in arrived

    simulator = rospy.Publisher("/sim/state", String, queue_size=1, latch=True)
    until(lambda: passes() == (True, True), "both come through", TIMEOUT_S)
    simulator.publish(String(json.dumps({"lift_off_s": rospy.get_time()})))
    until(lambda: told() == [False, True], "the fault begins", TIMEOUT_S)
    while select.select([control], [], [], 0.2)[0]:
        control.recv(100)  # what was under way
    assert passes() == (True, False)
    until(lambda: told() == [False, True, False], "the fault ends", TIMEOUT_S)
    until(lambda: passes() == (True, True), "both come through again", TIMEOUT_S)
    begins, ends = (json.loads(line)["t_s"] for line in log.read_text().splitlines()[1:])
    assert 0.9 < ends - begins < 1.5
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

        until(comes, f"{data!r} at +{at}", TIMEOUT_S)
        got, source = listeners[at].recvfrom(100)
        assert got == data
        return source

    arrives(talker, base, 1, b"video")
    arrives(talker, base + 2, 3, b"report")
    autopilots_peer = arrives(talker, base + 4, 5, b"control")
    arrives(listeners[5], autopilots_peer[1], 8, b"telemetry")
    for each in (talker, *listeners.values()):
        each.close()
