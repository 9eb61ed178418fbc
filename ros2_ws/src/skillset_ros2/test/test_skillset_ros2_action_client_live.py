"""Clients of actions on a live ROS 2 graph whose responses arrive before their requests were noted."""

from __future__ import annotations

import time

import pytest

rclpy = pytest.importorskip("rclpy")
navigation_actions = pytest.importorskip("navigation_interfaces.action")

from action_msgs.msg import GoalStatus  # noqa: E402
from rclpy.action import ActionServer, CancelResponse  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.task import Future  # noqa: E402
from skillset_ros2_rig import SOON_S, until  # noqa: E402

from skillset_ros2 import ActionClient  # noqa: E402

Hover = navigation_actions.Hover
DROPPED_S = 0.5
"""So long a request takes to be noted after it was sent, wall clock: time for its response to be taken, and dropped."""


class SlowToNote:
    """rclpy's inner client: what sends returns when the executor has had time to take the response."""

    def __init__(self, inside) -> None:
        self._inside = inside

    def __getattr__(self, name):
        inner = getattr(self._inside, name)
        return self._slow(inner) if name.startswith("send_") else inner

    def __enter__(self):
        return self._inside.__enter__()

    def __exit__(self, *error):
        return self._inside.__exit__(*error)

    def _slow(self, send):
        def slow(request):
            number = send(request)
            time.sleep(DROPPED_S)
            return number

        return slow


@pytest.fixture
def client(spinning):
    told = Future()

    async def execute(goal):
        await told
        goal.canceled()
        return Hover.Result(outcome="INTERRUPTED")

    def cancel(_):
        told.set_result(None)
        return CancelResponse.ACCEPT

    server = ActionServer(spinning.spin(Node("hovering")), Hover, "hover", execute, cancel_callback=cancel)
    client = ActionClient(spinning.spin(Node("asking")), Hover, "hover")
    assert client.wait_for_server(SOON_S)
    yield client
    client.destroy()
    server.destroy()


def test_a_response_that_is_there_before_its_request_is_noted_is_heard(client):
    client._client_handle = SlowToNote(client._client_handle)
    sent = client.send_goal_async(Hover.Goal())
    until(sent.done, "the goal is accepted")
    canceled = sent.result().cancel_goal_async()
    until(canceled.done, "the cancellation is answered")
    assert len(canceled.result().goals_canceling) == 1
    ended = sent.result().get_result_async()
    until(ended.done, "the result is heard")
    assert (ended.result().status, ended.result().result.outcome) == (GoalStatus.STATUS_CANCELED, "INTERRUPTED")
