"""How long plain action clients can ask for the results of skills on a live ROS 2 graph, by the mission clock."""

from __future__ import annotations

import pytest

rclpy = pytest.importorskip("rclpy")
navigation_actions = pytest.importorskip("navigation_interfaces.action")

from action_msgs.msg import GoalStatus  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from skillset_ros2_rig import SOON_S, Navigation, until  # noqa: E402

from alula_testing.navigation import FLYING  # noqa: E402
from skillset_ros2 import ActionClient  # noqa: E402

KEPT_S = 900.0
"""rclpy's default (``result_timeout`` of ``ActionServer``, 7.1.6)."""
BEGIN_S = 100.0


@pytest.mark.parametrize("flown_s", [10.0, 2 * KEPT_S])
def test_a_result_is_kept_for_plain_clients_for_a_quarter_of_an_hour_after_the_end(spinning, flown_s):
    navigation = Navigation(spinning, parameter_overrides=[Parameter("use_sim_time", value=True)])
    set_time = navigation.mission_clock()
    set_time(BEGIN_S)
    navigation.bring(FLYING)
    client = ActionClient(navigation.node, navigation_actions.GotoStraight, "navigation/skill/goto_straight")
    assert client.wait_for_server(SOON_S)
    sent = client.send_goal_async(navigation_actions.GotoStraight.Goal(speed=1.0))
    until(sent.done, "the goal is accepted")
    until(lambda: navigation.managers.engine.executions, "it runs")

    def ask():
        asked = sent.result().get_result_async()
        until(asked.done, "the server answers")
        return asked.result().status, asked.result().result.outcome, asked.result().result.result

    end_s = BEGIN_S + flown_s
    set_time(end_s)
    until(lambda: navigation.managers.engine.executions[0].terminate("ARRIVED"), "it ends")
    kept = (GoalStatus.STATUS_SUCCEEDED, "TERMINATED", "ARRIVED")
    assert ask() == kept
    set_time(end_s + KEPT_S - 1.0)
    assert ask() == kept
    set_time(end_s + KEPT_S + 1.0)
    until(lambda: ask() == (GoalStatus.STATUS_UNKNOWN, "", ""), "it is forgotten then: memory has an end")
    client.destroy()
