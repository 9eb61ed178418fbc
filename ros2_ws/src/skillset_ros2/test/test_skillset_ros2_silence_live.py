"""Resources whose reporter falls silent, on a live graph."""

from __future__ import annotations

import re

import pytest

rclpy = pytest.importorskip("rclpy")
navigation_actions = pytest.importorskip("navigation_interfaces.action")

from navigation_managers.model import SKILLSET  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.time import Time  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from skillset_interfaces.msg import ResourceStates  # noqa: E402
from skillset_ros2_rig import READY_S, NavigationRecorder, take, until  # noqa: E402

from alula.runtime.middleware import REPORTED  # noqa: E402
from alula_testing.navigation import with_silence  # noqa: E402
from skillset_ros2 import Heartbeat, SkillsetClient, SkillsetNode  # noqa: E402
from skillset_ros2.names import latched  # noqa: E402

UNKNOWN = SKILLSET.resource("SDK_authority").initial


def test_a_resource_whose_reporter_falls_silent_is_unknown(spinning):
    model = with_silence(SKILLSET, "SDK_authority", 900.0)
    given = [Parameter("silence.navigation.SDK_authority", value=2.0)]  # as a deployment gives it
    hooks = lambda _: {skill.name: NavigationRecorder() for skill in model.skills}  # noqa: E731
    spinning.spin(SkillsetNode(model, navigation_actions, hooks, parameter_overrides=given))
    node = Node("silence_tester")
    client = SkillsetClient(node, "navigation")
    beats: list = []
    node.create_subscription(ResourceStates, f"navigation/{REPORTED.name}", beats.append, latched(REPORTED.depth))
    heartbeat = Heartbeat(spinning.spin(node), "navigation", "SDK_authority")
    assert client.wait_ready(READY_S)
    take(node, "SDK_authority", "AVAILABLE")
    beats.clear()
    until(lambda: beats, "it is heard of")
    heartbeat.close()
    until(lambda: client.resources["SDK_authority"] == SKILLSET.resource("SDK_authority").initial, "it is unknown")
    assert client.model.resource("SDK_authority").silence_s == 2.0
    until(lambda: silent_s(client) >= 3.0, "it is told for how long")


def test_managers_count_a_silence_by_their_own_clock_however_fast_the_reporters_is(spinning):
    """A simulated base that stands: to managers with its clock nothing lasts; those with the monotonic one hear it all the same."""
    simulated, model = [Parameter("use_sim_time", value=True)], with_silence(SKILLSET, "SDK_authority", 2.0)
    hooks = lambda _: {skill.name: NavigationRecorder() for skill in model.skills}  # noqa: E731
    here, there = Node("silence_tester"), Node("silence_tester", namespace="lockstep", parameter_overrides=simulated)
    managers = [
        spinning.spin(SkillsetNode(model, navigation_actions, hooks)),
        spinning.spin(SkillsetNode(model, navigation_actions, hooks, namespace="lockstep", parameter_overrides=simulated)),
    ]
    clock = here.create_publisher(Clock, "/clock", 10)

    def sets_time(seconds: float) -> bool:
        clock.publish(Clock(clock=Time(seconds=seconds).to_msg()))
        return all(one.get_clock().now().nanoseconds == int(seconds * 1e9) for one in (managers[1], there))

    clients = [SkillsetClient(node, "navigation") for node in (here, there)]
    base = Node("base", parameter_overrides=simulated)  # attached: the managers have no /clock, what reports to them has
    beats: list = []
    base.create_subscription(ResourceStates, f"navigation/{REPORTED.name}", beats.append, latched(REPORTED.depth))
    attached = Heartbeat(spinning.spin(base), "navigation", "SDK_authority")
    lockstep = Heartbeat(there, "navigation", "SDK_authority")
    for node, client in zip((here, there), clients, strict=True):
        spinning.spin(node)
        assert client.wait_ready(READY_S)
    until(lambda: sets_time(100.0), "the clock begins")
    for node, client in zip((here, there), clients, strict=True):
        take(node, "SDK_authority", "AVAILABLE")
        until(lambda c=client: c.resources["SDK_authority"] == "AVAILABLE", "it is reported")  # type: ignore[misc]
    beats.clear()
    until(lambda: len(beats) > 6, "more than the limit has passed")
    assert [client.resources["SDK_authority"] for client in clients] == ["AVAILABLE", "AVAILABLE"]
    attached.close()
    lockstep.close()
    until(lambda: clients[0].resources["SDK_authority"] == UNKNOWN, "nothing is heard any more, by the monotonic clock")
    assert clients[1].resources["SDK_authority"] == "AVAILABLE", "the simulator is suspended: no time has passed in the run"
    until(lambda: sets_time(103.0), "the simulator goes on")
    until(lambda: clients[1].resources["SDK_authority"] == UNKNOWN, "nothing is heard any more, by the mission clock")


def silent_s(client) -> float:
    """For how long nothing was heard, as the client is told."""
    told = re.fullmatch(r"not heard of for ([\d.]+) s", client.reasons["SDK_authority"])
    assert told is not None, client.reasons
    return float(told[1])
