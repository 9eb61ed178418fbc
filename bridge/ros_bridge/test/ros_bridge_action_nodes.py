"""rclpy's ends of actions for live tests: goals that are followed, and a server that does as each goal says."""

import threading
import time
import uuid

import rclpy
from bridge_test_interfaces.action import Count
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor

from alula_testing.ros2 import spin
from alula_testing.waits import HANGS_S, until
from skillset_ros2 import ActionClient

MET_S = 3.0


class Sent:
    """A goal of the rclpy client: its answer, feedback, states and result as they come."""

    def __init__(self, client: ActionClient, **fields: object) -> None:
        self.feedback: list[Count.Feedback] = []
        self.future = client.send_goal_async(Count.Goal(**fields), lambda message: self.feedback.append(message.feedback))
        self.result_future = None

    def answered(self):
        until(self.future.done, "the goal is answered")
        return self.future.result()

    def accepted(self):
        handle = self.answered()
        assert handle.accepted
        self.result_future = handle.get_result_async()
        return handle

    def result(self, within_s: float = HANGS_S):
        if self.result_future is None:
            self.accepted()
        until(self.result_future.done, "the goal has a result", within_s)
        return self.result_future.result()

    def cancel(self):
        future = self.future.result().cancel_goal_async()
        until(future.done, "the cancel request is answered")
        return future.result()


def feedback_arrives(client):
    """Return whether a goal brings its answers and feedback.

    A reader that has found its writer may still be unknown to it: rmw_fastrtps drops an answer after 0.1 s of that, and rclpy's
    client does not ask again.
    """
    sent = Sent(client, target=10, period_s=0.01, behaviour="count")
    if not done_soon(sent.future):
        return []
    sent.accepted()
    return sent.feedback if done_soon(sent.result_future) else []


def done_soon(future):
    end_s = time.monotonic() + MET_S
    while not future.done() and time.monotonic() < end_s:
        time.sleep(0.01)
    return future.done()


class ActionNode:
    """An rclpy node spun by several threads. rclpy's executor dies when an action's end is destroyed while it spins: stop it first."""

    def __init__(self) -> None:
        self.node = rclpy.create_node(f"bridge_action_test_{uuid.uuid4().hex[:8]}")
        self.group = ReentrantCallbackGroup()
        self.executor = MultiThreadedExecutor(4)
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=spin, args=(self.executor,), daemon=True)
        self.clients: dict[str, ActionClient] = {}
        self.servers: list[ActionServer] = []
        self.started: list[ActionNode] = []
        self.release = threading.Event()  # ends what its server executes: Python waits for these threads when it ends

    def client(self, name: str) -> ActionClient:
        if name not in self.clients:
            self.clients[name] = ActionClient(self.node, Count, name, callback_group=self.group)
        assert self.clients[name].wait_for_server(HANGS_S)
        return self.clients[name]

    def server(self, name: str) -> "CountServer":
        node = ActionNode()
        server = CountServer(node, name)
        node.servers.append(server.server)
        node.thread.start()
        self.started.append(node)
        return server

    def tidy(self) -> None:
        while self.started:
            self.started.pop().close()

    def close(self) -> None:
        self.tidy()
        self.executor.shutdown(timeout_sec=0.0)
        if self.thread.is_alive():
            self.thread.join(5.0)
        self.release.set()  # only now: what ends would else be told to an executor that has let go of what wakes it
        for end in (*self.servers, *self.clients.values()):
            end.destroy()
        self.node.destroy_node()


class CountServer:
    """An rclpy server that behaves as each goal says: count, held (count, end when told), hang, stubborn, abort, reject, deaf."""

    def __init__(self, owner: ActionNode, name: str) -> None:
        self.goals: list = []
        self.release = owner.release
        self.finish = threading.Event()
        self.server = ActionServer(
            owner.node,
            Count,
            name,
            execute_callback=self._execute,
            goal_callback=self._on_goal,
            cancel_callback=self._on_cancel,
            callback_group=owner.group,
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
        if goal.behaviour == "held":
            self.finish.wait(HANGS_S)
        if goal.behaviour == "abort":
            handle.abort()
        else:
            handle.succeed()
        return Count.Result(counted=counted, message="from ROS 2")
