"""Resources whose reporter falls silent, on a live graph."""

from __future__ import annotations

import pytest

rclpy = pytest.importorskip("rclpy")
navigation_actions = pytest.importorskip("navigation_interfaces.action")

from navigation_managers.model import SKILLSET  # noqa: E402
from rclpy.node import Node  # noqa: E402
from skillset_interfaces.msg import ResourceStates  # noqa: E402
from skillset_ros2_rig import READY_S, NavigationRecorder, take, until  # noqa: E402

from alula.runtime.middleware import REPORTED  # noqa: E402
from alula_testing.navigation import with_silence  # noqa: E402
from skillset_ros2 import Heartbeat, SkillsetClient, SkillsetNode  # noqa: E402
from skillset_ros2.names import latched  # noqa: E402


def test_a_resource_whose_reporter_falls_silent_is_unknown(spinning):
    model = with_silence(SKILLSET, "SDK_authority", 2.0)
    spinning.spin(SkillsetNode(model, navigation_actions, lambda _: {skill.name: NavigationRecorder() for skill in model.skills}))
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
    assert client.reasons["SDK_authority"] == "not heard of for 2 s"
