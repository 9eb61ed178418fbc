"""Actions through the bridge as a process: real actionlib servers and clients in rospy, real action servers and clients in rclpy."""

import os
import signal
import threading
import time
import uuid

import pytest
import rclpy
from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from bridge_test_interfaces.action import Count
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.qos import qos_profile_action_status_default
from ros_bridge_harness import RUNNING, BridgeProcess, Master, Ros1Peer, wait_until

from alula_flight.claims import free_port
from alula_testing.ros2 import spin

CONFIG = """
topics: []
actions:
  - {name: /ba/in_ros1, server: ros1, type: bridge_test_interfaces/Count, timeout_s: 10.0}
  - {name: /ba/nobody, server: ros1, type: bridge_test_interfaces/Count, timeout_s: 0.6}
  - {name: /ba/mortal, server: ros1, type: bridge_test_interfaces/Count, timeout_s: 10.0}
  - {ros1_name: /ba/simple, ros2_name: /ba/renamed, server: ros1, type: bridge_test_interfaces/Count, timeout_s: 10.0}
  - {name: /ba/in_ros2, server: ros2, type: bridge_test_interfaces/Count, timeout_s: 10.0}
  - {name: /ba/nobody2, server: ros2, type: bridge_test_interfaces/Count, timeout_s: 0.6}
"""
WITHIN_S = 20.0


class Sent:
    """A goal of the rclpy client: its answer, feedback, states and result as they come."""

    def __init__(self, client: ActionClient, **fields: object) -> None:
        self.feedback: list[Count.Feedback] = []
        self.future = client.send_goal_async(Count.Goal(**fields), lambda message: self.feedback.append(message.feedback))
        self.result_future = None

    def answered(self):
        wait_until(self.future.done, "the goal is answered", WITHIN_S)
        return self.future.result()

    def accepted(self):
        handle = self.answered()
        assert handle.accepted
        self.result_future = handle.get_result_async()
        return handle

    def result(self, within_s: float = WITHIN_S):
        if self.result_future is None:
            self.accepted()
        wait_until(self.result_future.done, "the goal has a result", within_s)
        return self.result_future.result()

    def cancel(self):
        future = self.future.result().cancel_goal_async()
        wait_until(future.done, "the cancel request is answered", WITHIN_S)
        return future.result()


class Node2:
    """An rclpy node spun by several threads. rclpy's executor dies when an action's end is destroyed while it spins: stop it first."""

    def __init__(self) -> None:
        self.node = rclpy.create_node(f"bridge_action_test_{uuid.uuid4().hex[:8]}")
        self.group = ReentrantCallbackGroup()
        self.executor = MultiThreadedExecutor(4)
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=spin, args=(self.executor,), daemon=True)
        self.clients: dict[str, ActionClient] = {}
        self.servers: list[ActionServer] = []
        self.started: list[Node2] = []
        self.release = threading.Event()  # ends what its server executes: Python waits for these threads when it ends

    def client(self, name: str) -> ActionClient:
        if name not in self.clients:
            self.clients[name] = ActionClient(self.node, Count, name, callback_group=self.group)
        assert self.clients[name].wait_for_server(WITHIN_S)
        return self.clients[name]

    def server(self, name: str) -> "Server2":
        node2 = Node2()
        server = Server2(node2, name)
        node2.servers.append(server.server)
        node2.thread.start()
        self.started.append(node2)
        return server

    def tidy(self) -> None:
        while self.started:
            self.started.pop().close()

    def close(self) -> None:
        self.tidy()
        self.release.set()
        self.executor.shutdown(timeout_sec=0.0)
        if self.thread.is_alive():
            self.thread.join(5.0)
        for end in (*self.servers, *self.clients.values()):
            end.destroy()
        self.node.destroy_node()


class Server2:
    """An rclpy server that behaves as each goal says: count, hang, stubborn, abort, reject, deaf (refuses to cancel)."""

    def __init__(self, node2: Node2, name: str) -> None:
        self.goals: list = []
        self.release = node2.release
        self.server = ActionServer(
            node2.node,
            Count,
            name,
            execute_callback=self._execute,
            goal_callback=self._on_goal,
            cancel_callback=self._on_cancel,
            callback_group=node2.group,
        )

    @staticmethod
    def _on_goal(goal):
        return GoalResponse.REJECT if goal.behaviour == "reject" else GoalResponse.ACCEPT

    @staticmethod
    def _on_cancel(handle):
        return CancelResponse.REJECT if handle.request.behaviour == "deaf" else CancelResponse.ACCEPT

    def _execute(self, handle):
        self.goals.append(handle)
        goal = handle.request
        counted = []
        while (len(counted) < goal.target or goal.behaviour in ("hang", "deaf")) and not self.release.is_set():
            if handle.is_cancel_requested and goal.behaviour != "stubborn":
                handle.canceled()
                return Count.Result(counted=counted, message="cancelled")
            self.release.wait(goal.period_s)
            if goal.behaviour not in ("hang", "deaf"):
                counted.append(len(counted) + 1)
                handle.publish_feedback(Count.Feedback(count=counted[-1], fraction=counted[-1] / goal.target))
        self.release.wait(goal.period_s)  # neither world keeps the order of the last feedback and the result
        if goal.behaviour == "abort":
            handle.abort()
        else:
            handle.succeed()
        return Count.Result(counted=counted, message="from ROS 2")


@pytest.fixture(scope="module")
def master():
    master = Master(free_port())
    master.start()
    yield master
    master.close()


@pytest.fixture(scope="module")
def bridge(master, ros2_domain, tmp_path_factory):
    process = BridgeProcess(master, tmp_path_factory.mktemp("action_bridge"), CONFIG)
    process.wait_running()
    yield process
    process.close()


@pytest.fixture(scope="module")
def peers(bridge, master):
    ros1, ros2 = Ros1Peer(master, "ros_bridge_action_peer.py"), Node2()
    ros2.thread.start()
    ros1.do("serve", name="/ba/in_ros1")
    ros1.do("serve_simple", name="/ba/simple")
    for name in ("/ba/in_ros2", "/ba/nobody2"):
        ros1.do("client", name=name)
        assert ros1.expect("connected")["found"]
    yield ros1, ros2
    ros1.close()
    ros2.close()


@pytest.fixture(autouse=True)
def leave_nothing_running(peers):
    before = list(RUNNING)
    yield
    for process in RUNNING:
        if process not in before:
            process.close()
    RUNNING[:] = before


@pytest.fixture
def ros1(peers):
    return peers[0]


@pytest.fixture
def ros2(peers):
    yield peers[1]
    peers[1].tidy()


# From ROS 2 clients to an actionlib server.


def feedback_arrives(client):
    """Tell whether a goal brings feedback: a reader that has found its writer may still be unknown to it."""
    sent = Sent(client, target=10, period_s=0.01, behaviour="count")
    sent.result()
    return sent.feedback


def test_goal_feedback_and_result_cross_from_an_actionlib_server(ros1, ros2):
    client = ros2.client("/ba/in_ros1")
    wait_until(lambda: feedback_arrives(client), "the bridge knows the client's reader of feedback")
    sent = Sent(client, target=5, period_s=0.02, behaviour="count")
    answer = sent.result()
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    assert (list(answer.result.counted), answer.result.message) == ([1, 2, 3, 4, 5], "from ROS 1")
    wait_until(lambda: len(sent.feedback) == 5, "all feedback arrives")
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
    response = cancel.call(request, timeout_sec=WITHIN_S)
    assert {bytes(info.goal_id.uuid) for info in response.goals_canceling} == {bytes(handle.goal_id.uuid) for handle in handles}
    assert [goal.result().status for goal in goals] == [GoalStatus.STATUS_CANCELED] * 2
    assert not later.result_future.done()
    last = Sent(client, behaviour="hang", period_s=10.0)
    last.accepted()
    assert len(cancel.call(CancelGoal.Request(), timeout_sec=WITHIN_S).goals_canceling) == 2
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
    wait_until(lambda: (wanted, GoalStatus.STATUS_EXECUTING) in seen, "it is executing", WITHIN_S)
    sent.cancel()
    wait_until(lambda: (wanted, GoalStatus.STATUS_CANCELED) in seen, "it is cancelled", WITHIN_S)
    states = [status for goal, status in seen if goal == wanted]
    assert states == sorted(states)
    ros2.node.destroy_subscription(subscription)


def test_goal_without_a_server_in_ros1_is_rejected_when_its_time_is_over(ros2):
    client = ros2.client("/ba/nobody")
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
        start = time.monotonic()
        answer = sent.result()
        assert time.monotonic() - start < 3.0
        assert answer.status == GoalStatus.STATUS_ABORTED
        assert answer.result.message == "the server in ROS 1 is gone"


def test_result_of_an_unknown_goal_is_unknown(ros2):
    client = ros2.node.create_client(Count.Impl.GetResultService, "/ba/in_ros1/_action/get_result", callback_group=ros2.group)
    assert client.wait_for_service(WITHIN_S)
    assert client.call(Count.Impl.GetResultService.Request(), timeout_sec=WITHIN_S).status == GoalStatus.STATUS_UNKNOWN
    ros2.node.destroy_client(client)


def test_client_that_vanishes_leaves_its_goal_to_the_server_and_the_bridge_to_others(ros1, ros2):
    mortal = Node2()
    mortal.thread.start()
    sent = Sent(mortal.client("/ba/in_ros1"), target=7, period_s=0.1, behaviour="count")
    ros1.expect("goal", target=7)
    mortal.close()
    assert not sent.feedback or sent.feedback[-1].count < 7
    assert Sent(ros2.client("/ba/in_ros1"), target=1, behaviour="count").result().status == GoalStatus.STATUS_SUCCEEDED


# From actionlib clients to a ROS 2 server.


def send(ros1, name, key, **fields):
    ros1.do("goal", name=name, key=key, **fields)
    return ros1.expect("sent", key=key)


def ending(ros1, key):
    return ros1.expect("transition", key=key, state="DONE", within_s=WITHIN_S)


def test_goal_feedback_and_result_cross_from_a_ros2_server(ros1, ros2):
    ros2.server("/ba/in_ros2")
    send(ros1, "/ba/in_ros2", "a", target=4, period_s=0.05, behaviour="count")
    for number in range(1, 5):
        assert ros1.expect("feedback", key="a", count=number)["fraction"] == number / 4
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
    wait_until(lambda: len(server.goals) == 3, "all run at once", WITHIN_S)
    ros1.do("cancel_before", name="/ba/in_ros2", stamp_ns=second["stamp_ns"])
    assert {ros1.expect("transition", state="DONE", terminal="PREEMPTED")["key"] for _ in range(2)} == {"one", "two"}
    assert sum(handle.is_active for handle in server.goals) == 1
    ros1.do("cancel_all", name="/ba/in_ros2")
    assert ending(ros1, "three")["terminal"] == "PREEMPTED"


def test_goal_without_a_server_in_ros2_is_rejected_with_a_reason(ros1):
    send(ros1, "/ba/nobody2", "lonely", target=1)
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
    key = f"race {delay_s}"
    ros1.do("goal", name="/ba/in_ros2", key=key, target=3, period_s=0.005)
    threading.Event().wait(delay_s)
    ros1.do("cancel", key=key)
    assert ending(ros1, key)["terminal"] in ("PREEMPTED", "SUCCEEDED", "RECALLED")
    sent = Sent(ros2.client("/ba/in_ros1"), target=3, period_s=0.005, behaviour="count")
    sent.accepted()
    threading.Event().wait(delay_s)
    sent.cancel()
    assert sent.result().status in (GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_SUCCEEDED)
