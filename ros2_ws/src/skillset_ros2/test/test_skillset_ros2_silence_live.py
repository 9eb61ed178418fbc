"""Resources whose reporter falls silent, on a live graph."""

from __future__ import annotations

import re

import pytest

rclpy = pytest.importorskip("rclpy")
navigation_actions = pytest.importorskip("navigation_interfaces.action")

from navigation_managers.model import SKILLSET  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from skillset_interfaces.msg import ResourceStates  # noqa: E402
from skillset_ros2_rig import READY_S, NavigationRecorder, take, until  # noqa: E402

from alula.runtime.middleware import REPORTED  # noqa: E402
from alula_testing.navigation import with_silence  # noqa: E402
from skillset_ros2 import Heartbeat, SkillsetClient, SkillsetNode  # noqa: E402
from skillset_ros2.names import latched  # noqa: E402


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


def silent_s(client) -> float:
    """For how long nothing was heard, as the client is told."""
    told = re.fullmatch(r"not heard of for ([\d.]+) s", client.reasons["SDK_authority"])
    assert told is not None, client.reasons
    return float(told[1])
