"""Actions through the bridge as a process: from actionlib clients in rospy to real servers in rclpy."""

import json
import threading

import pytest
from action_msgs.msg import GoalStatus
from ros_bridge_action_nodes import Sent

from alula_testing.waits import until

UNNAMED = {"WAITING_FOR_GOAL_ACK", "WAITING_FOR_CANCEL_ACK", "DONE"}
"""States of actionlib's client of a goal that no list of states has named."""
CONFIG = """
topics: []
actions:
  - {name: /ba/in_ros1, server: ros1, type: bridge_test_interfaces/Count, timeout_s: 10.0}
  - {name: /ba/in_ros2, server: ros2, type: bridge_test_interfaces/Count, timeout_s: 10.0}
  - {name: /ba/unserved2, server: ros2, type: bridge_test_interfaces/Count, timeout_s: 0.6}
"""


@pytest.fixture(scope="module")
def ros1(action_ros1):
    action_ros1.do("serve", name="/ba/in_ros1")
    for name in ("/ba/in_ros2", "/ba/unserved2"):
        action_ros1.do("client", name=name)
        assert action_ros1.expect("connected")["found"]
    return action_ros1


@pytest.fixture
def ros2(ros1, action_ros2):
    return action_ros2


def send(ros1, name, key, **fields):
    """Send a goal, and return what was sent; transitions that the client has told before, of a fast server, are not passed over."""
    begin = len(ros1.lines)
    ros1.do("goal", name=name, key=key, **fields)
    sent = lambda: [one for one in map(json.loads, ros1.lines[begin:]) if (one["event"], one.get("key")) == ("sent", key)]  # noqa: E731
    until(sent, f"{key} is sent")
    return sent()[0]


def ending(ros1, key):
    return ros1.expect("transition", key=key, state="DONE")


def cancelled(ros1, key, delay_s):
    """Cancel a goal so long after it was sent, and return how it ended.

    Where the client has cancelled a goal that no list of states named yet, one that was sent before the goal arrived makes it call the goal
    lost (actionlib 1.14, ``update_status`` of its client). That is the client's race, with any server: another goal is sent.
    """
    for attempt in range(20):
        name, begin = f"{key} {attempt}", len(ros1.lines)
        ros1.do("goal", name="/ba/in_ros2", key=name, target=3, period_s=0.005)
        threading.Event().wait(delay_s)  # the moment is what is tested
        ros1.do("cancel", key=name)
        end = ending(ros1, name)
        events = [json.loads(line) for line in ros1.lines[begin:]]
        named = {one["state"] for one in events if (one["event"], one.get("key")) == ("transition", name)} - UNNAMED
        if named or end["terminal"] != "LOST":
            break
    return end["terminal"]


def test_goal_feedback_and_result_cross_from_a_ros2_server(ros1, ros2):
    server = ros2.server("/ba/in_ros2")
    send(ros1, "/ba/in_ros2", "a", target=4, period_s=0.05, behaviour="held")
    for number in range(1, 5):
        assert ros1.expect("feedback", key="a", count=number)["fraction"] == number / 4
    server.finish.set()  # neither world keeps the order of the last feedback and the result
    end = ending(ros1, "a")
    assert (end["terminal"], end["counted"], end["message"]) == ("SUCCEEDED", [1, 2, 3, 4], "from ROS 2")


def test_rejection_by_a_ros2_server_is_a_rejection_in_ros1(ros1, ros2):
    ros2.server("/ba/in_ros2")
    send(ros1, "/ba/in_ros2", "rejected", behaviour="reject")
    assert ending(ros1, "rejected")["terminal"] == "REJECTED"


def test_abortion_by_a_ros2_server_crosses_with_its_result(ros1, ros2):
    ros2.server("/ba/in_ros2")
    send(ros1, "/ba/in_ros2", "aborted", target=2, behaviour="abort")
    end = ending(ros1, "aborted")
    assert (end["terminal"], end["counted"]) == ("ABORTED", [1, 2])


def test_states_in_ros1_go_from_active_over_preempting_to_preempted(ros1, ros2):
    ros2.server("/ba/in_ros2")
    send(ros1, "/ba/in_ros2", "cancelled", behaviour="hang", period_s=0.2)
    ros1.expect("transition", key="cancelled", state="ACTIVE")
    ros1.do("cancel", key="cancelled")
    ros1.expect("transition", key="cancelled", state="PREEMPTING")
    end = ending(ros1, "cancelled")
    assert (end["terminal"], end["message"]) == ("PREEMPTED", "cancelled")


def test_refused_cancelling_leaves_the_goal_active_in_ros1(ros1, ros2):
    server = ros2.server("/ba/in_ros2")
    send(ros1, "/ba/in_ros2", "deaf", behaviour="deaf", period_s=0.05)
    ros1.expect("transition", key="deaf", state="ACTIVE")
    ros1.do("cancel", key="deaf")
    send(ros1, "/ba/in_ros2", "after", target=1)
    ending(ros1, "after")
    server.release.set()
    assert ending(ros1, "deaf")["terminal"] == "SUCCEEDED"


def test_several_goals_of_ros1_and_cancelling_by_stamp_and_all(ros1, ros2):
    server = ros2.server("/ba/in_ros2")
    first, second, third = (send(ros1, "/ba/in_ros2", key, behaviour="hang", period_s=0.05) for key in ("one", "two", "three"))
    assert first["stamp_ns"] < second["stamp_ns"] < third["stamp_ns"]
    until(lambda: len(server.goals) == 3, "all run at once")
    ros1.do("cancel_before", name="/ba/in_ros2", stamp_ns=second["stamp_ns"])
    assert {ros1.expect("transition", state="DONE", terminal="PREEMPTED")["key"] for _ in range(2)} == {"one", "two"}
    assert sum(handle.is_active for handle in server.goals) == 1
    ros1.do("cancel_all", name="/ba/in_ros2")
    assert ending(ros1, "three")["terminal"] == "PREEMPTED"


def test_goal_without_a_server_in_ros2_is_rejected_with_a_reason(ros1):
    send(ros1, "/ba/unserved2", "lonely", target=1)
    end = ending(ros1, "lonely")
    assert (end["terminal"], end["text"]) == ("REJECTED", "no server in ROS 2")


def test_goal_waits_for_a_ros2_server_that_comes_in_time(ros1, ros2):
    send(ros1, "/ba/in_ros2", "early", target=1)
    ros2.server("/ba/in_ros2")
    assert ending(ros1, "early")["terminal"] == "SUCCEEDED"


def test_ros2_server_that_goes_aborts_its_goals_and_its_successor_gets_the_next(ros1, ros2):
    for key in ("before", "again"):
        server = ros2.server("/ba/in_ros2")
        send(ros1, "/ba/in_ros2", key, behaviour="hang", period_s=0.05)
        ros1.expect("transition", key=key, state="ACTIVE")
        ros2.tidy()
        end = ending(ros1, key)
        assert (end["terminal"], end["text"]) == ("ABORTED", "the server in ROS 2 is gone")
        server.release.set()


@pytest.mark.parametrize("delay_s", [0.0, 0.002, 0.01, 0.05])
def test_cancelling_at_any_moment_ends_a_goal_exactly_once(ros1, ros2, delay_s):
    """The race of goal, answer, result and cancel request, both ways."""
    ros2.server("/ba/in_ros2")
    assert cancelled(ros1, f"race {delay_s}", delay_s) in ("PREEMPTED", "SUCCEEDED", "RECALLED")
    sent = Sent(ros2.client("/ba/in_ros1"), target=3, period_s=0.005, behaviour="count")
    sent.accepted()
    threading.Event().wait(delay_s)
    sent.cancel()
    assert sent.result().status in (GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_SUCCEEDED)
