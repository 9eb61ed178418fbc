"""Actions through the bridge as a process: from clients in rclpy to real actionlib servers in rospy."""

import os
import signal
import time
import uuid

import pytest
from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from bridge_test_interfaces.action import Count
from rclpy.qos import qos_profile_action_status_default
from ros_bridge_action_nodes import ActionNode, Sent, feedback_arrives
from ros_bridge_harness import Ros1Peer

from alula_testing.waits import HANGS_S, until

CONFIG = """
topics: []
actions:
  - {name: /ba/in_ros1, server: ros1, type: bridge_test_interfaces/Count, timeout_s: 10.0}
  - {name: /ba/unserved, server: ros1, type: bridge_test_interfaces/Count, timeout_s: 0.6}
  - {name: /ba/mortal, server: ros1, type: bridge_test_interfaces/Count, timeout_s: 10.0}
  - {ros1_name: /ba/simple, ros2_name: /ba/renamed, server: ros1, type: bridge_test_interfaces/Count, timeout_s: 10.0}
"""


@pytest.fixture(scope="module")
def ros1(action_ros1):
    action_ros1.do("serve", name="/ba/in_ros1")
    action_ros1.do("serve_simple", name="/ba/simple")
    return action_ros1


@pytest.fixture
def ros2(ros1, action_ros2):
    return action_ros2


def test_goal_feedback_and_result_cross_from_an_actionlib_server(ros1, ros2):
    client = ros2.client("/ba/in_ros1")
    until(lambda: feedback_arrives(client), "the bridge knows the client's reader of feedback")
    sent = Sent(client, target=5, period_s=0.02, behaviour="held")
    until(lambda: len(sent.feedback) == 5, "all feedback arrives")
    ros1.do("finish")  # neither world keeps the order of the last feedback and the result
    answer = sent.result()
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    assert (list(answer.result.counted), answer.result.message) == ([1, 2, 3, 4, 5], "from ROS 1")
    assert [(feedback.count, feedback.fraction) for feedback in sent.feedback] == [(number, number / 5) for number in range(1, 6)]
    assert ros1.expect("goal", target=5)["id"] == str(uuid.UUID(bytes=bytes(sent.future.result().goal_id.uuid)))


def test_rejection_by_an_actionlib_server_is_a_rejection_in_ros2(ros2):
    assert not Sent(ros2.client("/ba/in_ros1"), behaviour="reject").answered().accepted


def test_abortion_by_an_actionlib_server_crosses_with_its_result(ros2):
    answer = Sent(ros2.client("/ba/in_ros1"), target=2, behaviour="abort").result()
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert (list(answer.result.counted), answer.result.message) == ([1, 2], "aborted")


def test_cancelling_at_an_actionlib_server(ros1, ros2):
    sent = Sent(ros2.client("/ba/in_ros1"), behaviour="hang", period_s=10.0)
    sent.accepted()
    assert len(sent.cancel().goals_canceling) == 1
    answer = sent.result()
    assert (answer.status, answer.result.message) == (GoalStatus.STATUS_CANCELED, "cancelled")
    late = sent.cancel()
    assert (late.return_code, late.goals_canceling) == (CancelGoal.Response.ERROR_GOAL_TERMINATED, [])


def test_server_that_ignores_the_cancelling_still_succeeds(ros2):
    sent = Sent(ros2.client("/ba/in_ros1"), target=3, period_s=0.1, behaviour="stubborn")
    sent.accepted()
    sent.cancel()
    answer = sent.result()
    assert (answer.status, list(answer.result.counted)) == (GoalStatus.STATUS_SUCCEEDED, [1, 2, 3])


def test_several_goals_at_once_and_cancelling_by_stamp_and_all(ros2):
    client = ros2.client("/ba/in_ros1")
    goals = [Sent(client, behaviour="hang", period_s=10.0) for _ in range(2)]
    handles = [goal.accepted() for goal in goals]
    later = Sent(client, behaviour="hang", period_s=10.0)
    later.accepted()
    cancel = ros2.node.create_client(CancelGoal, "/ba/in_ros1/_action/cancel_goal", callback_group=ros2.group)
    request = CancelGoal.Request()
    request.goal_info.stamp = max((handle.stamp for handle in handles), key=lambda stamp: (stamp.sec, stamp.nanosec))
    response = cancel.call(request, timeout_sec=HANGS_S)
    assert {bytes(info.goal_id.uuid) for info in response.goals_canceling} == {bytes(handle.goal_id.uuid) for handle in handles}
    assert [goal.result().status for goal in goals] == [GoalStatus.STATUS_CANCELED] * 2
    assert not later.result_future.done()
    last = Sent(client, behaviour="hang", period_s=10.0)
    last.accepted()
    assert len(cancel.call(CancelGoal.Request(), timeout_sec=HANGS_S).goals_canceling) == 2
    assert [later.result().status, last.result().status] == [GoalStatus.STATUS_CANCELED] * 2
    ros2.node.destroy_client(cancel)


def test_newer_goal_preempts_the_running_one_of_a_simple_server_which_ends_aborted(ros1, ros2):
    client = ros2.client("/ba/renamed")
    first = Sent(client, target=1, behaviour="hang")
    first.accepted()
    ros1.expect("goal", target=1)
    second = Sent(client, target=2)
    assert second.result().status == GoalStatus.STATUS_SUCCEEDED
    answer = first.result()
    assert (answer.status, answer.result.message) == (GoalStatus.STATUS_ABORTED, "preempted")


def test_states_in_ros2_go_from_accepted_to_executing_to_the_end(ros2):
    seen: list[tuple[bytes, int]] = []
    client = ros2.client("/ba/in_ros1")
    subscription = ros2.node.create_subscription(
        GoalStatusArray,
        "/ba/in_ros1/_action/status",
        lambda message: seen.extend((bytes(status.goal_info.goal_id.uuid), status.status) for status in message.status_list),
        qos_profile_action_status_default,
        callback_group=ros2.group,
    )
    sent = Sent(client, behaviour="hang", period_s=10.0)
    wanted = bytes(sent.accepted().goal_id.uuid)
    until(lambda: (wanted, GoalStatus.STATUS_EXECUTING) in seen, "it is executing")
    sent.cancel()
    until(lambda: (wanted, GoalStatus.STATUS_CANCELED) in seen, "it is cancelled")
    states = [status for goal, status in seen if goal == wanted]
    assert states == sorted(states)
    ros2.node.destroy_subscription(subscription)


def test_goal_without_a_server_in_ros1_is_rejected_when_its_time_is_over(ros2):
    client = ros2.client("/ba/unserved")
    start = time.monotonic()
    assert not Sent(client).answered().accepted
    assert time.monotonic() - start > 0.5


def test_goal_that_an_actionlib_server_only_queues_is_accepted_and_can_be_cancelled(ros1, ros2):
    sent = Sent(ros2.client("/ba/in_ros1"), behaviour="silent")
    sent.accepted()
    ros1.expect("goal", behaviour="silent")
    assert len(sent.cancel().goals_canceling) == 1


def test_killed_actionlib_server_aborts_its_goals_and_its_successor_gets_the_next(ros2, master):
    client = ros2.client("/ba/mortal")
    for _ in range(2):
        server = Ros1Peer(master, "ros_bridge_action_peer.py")
        server.do("serve", name="/ba/mortal")
        sent = Sent(client, behaviour="hang", period_s=10.0)
        sent.accepted()
        os.killpg(server.process.pid, signal.SIGKILL)
        answer = sent.result()
        assert answer.status == GoalStatus.STATUS_ABORTED
        assert answer.result.message == "the server in ROS 1 is gone"


def test_result_of_an_unknown_goal_is_unknown(ros2):
    client = ros2.node.create_client(Count.Impl.GetResultService, "/ba/in_ros1/_action/get_result", callback_group=ros2.group)
    assert client.wait_for_service(HANGS_S)
    assert client.call(Count.Impl.GetResultService.Request(), timeout_sec=HANGS_S).status == GoalStatus.STATUS_UNKNOWN
    ros2.node.destroy_client(client)


def test_client_that_vanishes_leaves_its_goal_to_the_server_and_the_bridge_to_others(ros1, ros2):
    mortal = ActionNode()
    mortal.thread.start()
    sent = Sent(mortal.client("/ba/in_ros1"), target=7, period_s=0.1, behaviour="count")
    ros1.expect("goal", target=7)
    mortal.close()
    assert not sent.feedback or sent.feedback[-1].count < 7
    assert Sent(ros2.client("/ba/in_ros1"), target=1, behaviour="count").result().status == GoalStatus.STATUS_SUCCEEDED
