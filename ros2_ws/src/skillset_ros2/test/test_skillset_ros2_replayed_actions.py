"""Goals of actionlib servers in a replay: answered as they were then."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

pytest.importorskip("action_msgs")

from action_msgs.msg import GoalStatus
from std_srvs.srv import SetBool, Trigger

from alula.runtime.local.clock import VirtualClock
from skillset_ros2 import ActionClient, ActionSkill, ServiceSkill, Watch
from skillset_ros2.replay.actions import RecordedActionClient
from skillset_ros2.replay.node import BagNode


def message(number, **fields):
    return SimpleNamespace(goal_id=SimpleNamespace(id=f"goal {number}"), **fields)


class Layer:
    """A server whose goals were to go to 1 and to 2."""

    def __init__(self):
        self.subscribers, self.differences = {}, []
        goals = [message(number, goal={"header": {"seq": number}, "x": float(number), "__msgtype__": "Goal"}) for number in (1, 2)]
        self.client = RecordedActionClient("/drive", goals, self.subscribers, self.differences.append)

    def say(self, topic, number, status, **fields):
        for hear in self.subscribers[f"/drive/{topic}"]:
            hear(SimpleNamespace(status=message(number, status=status), **fields))


def test_a_goal_hears_what_was_heard_of_it_then_and_ends_as_it_did():
    layer, heard, ends = Layer(), [], []
    assert layer.client.server_is_ready()
    sent = layer.client.send_goal_async({"header": {}, "x": 1.0}, lambda feedback: heard.append(feedback.feedback))
    sent.add_done_callback(lambda future: future.result().get_result_async().add_done_callback(lambda one: ends.append(one.result())))
    layer.say("feedback", 1, 1, feedback="half way")
    layer.say("feedback", 7, 1, feedback="of another client's goal")
    assert (sent.result().accepted, heard, ends) == (True, ["half way"], [])
    layer.say("result", 1, 4, result="blocked")
    assert [(end.status, end.result) for end in ends] == [(GoalStatus.STATUS_ABORTED, "blocked")]
    refused = layer.client.send_goal_async({"header": {}, "x": 2.0})
    layer.say("result", 2, 5, result=None)
    assert not refused.result().accepted
    assert layer.differences == []


def test_a_goal_that_was_not_sent_then_is_a_difference():
    layer = Layer()
    assert layer.client.send_goal_async({"header": {}, "x": 3.0}).result() is None
    assert layer.differences == ['goal of /drive: then {"x": 1.0}, now {"x": 3.0}']


def test_hooks_get_their_client_from_the_node_of_a_replay():
    made = object()
    assert ActionClient(SimpleNamespace(create_action_client=lambda kind, name: (made, kind, name)), int, "/drive") == (made, int, "/drive")


class Drive(ActionSkill):
    action, server = object, "drive"


class Switch(ServiceSkill):
    service, server, stop_service, stop_server = SetBool, "switch", Trigger, "switch/stop"


@pytest.mark.parametrize("kind", [Drive, Switch])
def test_in_a_replay_there_is_nothing_to_be_stopped_at_the_start(kind):
    clock, calls = VirtualClock(), []
    node = BagNode(clock, lambda name, _: calls.append(name), {}, lambda: False, lambda _: SimpleNamespace(server_is_ready=lambda: True))
    hooks = kind(Watch(node))
    hooks.on_start()
    while clock.do_next(5 * 10**9):
        pass
    assert (calls, hooks.stops_first) == ([], False)
