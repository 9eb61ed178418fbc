"""The real managers and hooks, each skillset in a process of its own, over a functional layer that is faked in ROS 2."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest
import rclpy
from move_base_msgs.action import MoveBase
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from skillset_interfaces.srv import Transition
from skillset_ros2 import SkillsetClient
from std_msgs.msg import String
from std_srvs.srv import SetBool

TIMEOUT_S = 60.0
SKILLSETS = ("base", "cargo")


class FakeLayer:
    """Localisation, door and people: each does what the test tells it, when it tells it."""

    def __init__(self, node):
        self.goals, self.cancelled = [], []
        self.doors, self.asked, self.said = [], [], None
        group = ReentrantCallbackGroup()
        for name in ("localize", "move_base"):
            ActionServer(node, MoveBase, f"/{name}", self._execute, callback_group=group, cancel_callback=lambda _: CancelResponse.ACCEPT)
        node.create_service(SetBool, "/door/kitchen/open", self._open, callback_group=group)
        node.create_subscription(String, "/person/ask", lambda message: self.asked.append(message.data), 5)
        self.answers = node.create_publisher(String, "/person/answer", 5)

    def _execute(self, goal):
        self.goals.append(goal)
        while not goal.is_cancel_requested:
            goal.publish_feedback(MoveBase.Feedback())
            time.sleep(0.05)
        self.cancelled.append(goal)
        goal.canceled()
        return MoveBase.Result()

    def _open(self, _request, response):
        """Answer when the test has said what."""
        door = len(self.doors)
        self.doors.append(None)
        while self.doors[door] is None:
            time.sleep(0.02)
        response.success, response.message = self.doors[door]
        return response


class Rig:
    """The managers' process, the fakes, and clients."""

    def __init__(self):
        hooks = [f"{name}=rover_robot.hooks.{name}:make_hooks" for name in SKILLSETS]
        self.managers = subprocess.Popen([sys.executable, "-m", "skillset_ros2.managers", *hooks])
        self.node = rclpy.create_node("rover_test")
        self.layer = FakeLayer(self.node)
        self.clients = {name: SkillsetClient(self.node, name) for name in SKILLSETS}
        self.transition = self.node.create_client(Transition, "/base/transition")
        self.executor = MultiThreadedExecutor(num_threads=8)
        self.executor.add_node(self.node)
        self.until(lambda: all(client.ready for client in self.clients.values()) and self.transition.service_is_ready())
        told = self.transition.call_async(Transition.Request(resource="link", to="UP"))  # as its dead man reports it
        self.until(told.done)

    def until(self, condition):
        end = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < end, "not in time"
            self.executor.spin_once(timeout_sec=0.05)

    def start(self, skill, **inputs):
        skillset, _, name = skill.partition(".")
        return self.clients[skillset].start(name, **inputs)

    def end(self, handle):
        self.until(lambda: handle.done)
        return handle.outcome, handle.result

    def close(self):
        self.layer.doors = [(False, "over")] * len(self.layer.doors)
        self.executor.shutdown()
        self.node.destroy_node()
        self.managers.send_signal(signal.SIGINT)
        assert self.managers.wait(TIMEOUT_S) == 0


@pytest.fixture(scope="module")
def rig(ros2_domain):
    rig = Rig()
    yield rig
    rig.close()


def test_a_search_for_the_pose_is_stopped_in_the_functional_layer(rig):
    handle = rig.start("base.localise")
    rig.until(lambda: rig.layer.goals)
    handle.interrupt()
    assert rig.end(handle)[0] == "INTERRUPTED"
    rig.until(lambda: rig.layer.cancelled == rig.layer.goals)
    again = rig.start("base.localise")  # the wheels are free
    rig.until(lambda: len(rig.layer.goals) == 2)
    again.interrupt()
    assert rig.end(again)[0] == "INTERRUPTED"


def test_a_door_that_answers_late_answers_nobody(rig):
    late = rig.start("cargo.open_door", door="kitchen")
    assert rig.end(late) == ("TERMINATED", "UNREACHABLE")
    now = rig.start("cargo.open_door", door="kitchen")
    rig.until(lambda: len(rig.layer.doors) == 2)
    rig.layer.doors[0] = (True, "open at last")
    rig.layer.doors[1] = (False, "it stays shut")
    assert rig.end(now) == ("TERMINATED", "SHUT")
    assert now.message == "it stays shut"


def test_a_question_takes_its_own_answer_only(rig):
    handle = rig.start("cargo.ask", text="Please let me pass.", patience=30.0)
    rig.until(lambda: rig.layer.asked)
    rig.layer.answers.publish(String(data="done Where am I?"))
    rig.layer.answers.publish(String(data="done Please let me pass."))
    assert rig.end(handle) == ("TERMINATED", "ANSWERED")
