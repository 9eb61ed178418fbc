"""A goal that was taken and that nobody tells of: its caller is not left waiting."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")
actions = pytest.importorskip("navigation_interfaces.action")

from skill_model.execution_state import ExecutionState  # noqa: E402
from skill_runtime.ros2 import pursuit  # noqa: E402


class Answered:
    """A future with its result, or with none ever."""

    def __init__(self, *results):
        self._results = results

    def result(self):
        return self._results[0]

    def add_done_callback(self, callback):
        if self._results:
            callback(self)


class ManagersThatTakeAndDie:
    """An action client whose server accepts the goal and is never heard of again."""

    def __init__(self):
        self.cancelled = 0

    def send_goal_async(self, _goal, _on_feedback, _goal_id):
        return Answered(SimpleNamespace(accepted=True))

    def _get_result_async(self, _goal_handle):
        return Answered()

    def _cancel_goal_async(self, _goal_handle):
        self.cancelled += 1
        return Answered()


@pytest.mark.parametrize("heard", [False, True])
def test_a_goal_that_nobody_tells_of_ends(monkeypatch, heard):
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(pursuit.time, "monotonic", lambda: now.s)
    client = ManagersThatTakeAndDie()
    followed = pursuit.Pursuit("navigation", "hover", actions.Hover, client)
    followed.send(actions.Hover.Goal())
    if heard:
        followed.on_event(SimpleNamespace(state="RUNNING"))
    now.s += pursuit.SILENCE_LIMIT_S - 0.1
    followed.tick()
    assert not followed.handle.done
    assert followed.restless is not heard
    now.s += 0.2
    followed.tick()
    assert (followed.handle.state, client.cancelled) == ((ExecutionState.RUNNING, 0) if heard else (ExecutionState.FAILED, 1))
