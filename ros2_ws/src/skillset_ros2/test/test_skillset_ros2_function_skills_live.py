"""Skills whose function is an action or a service: the drone's managers with such hooks, over live servers."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import ClassVar

import pytest

rclpy = pytest.importorskip("rclpy")
navigation_actions = pytest.importorskip("navigation_interfaces.action")

from action_msgs.msg import GoalStatus  # noqa: E402
from navigation_managers.hooks import AbstractGotoStraightSkill  # noqa: E402
from navigation_managers.model import SKILLSET  # noqa: E402
from rclpy.action import ActionServer, CancelResponse, GoalResponse  # noqa: E402
from rclpy.callback_groups import ReentrantCallbackGroup  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.task import Future  # noqa: E402
from skillset_ros2_rig import READY_S, SOON_S, NavigationRecorder, take, until  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

from alula.model.execution_state import ExecutionState  # noqa: E402
from alula.runtime.core.errors import SkillRuntimeError  # noqa: E402
from alula_testing.navigation import FLYING  # noqa: E402
from skillset_ros2 import ActionClient, ActionSkill, Ending, ServiceSkill, SkillsetClient, SkillsetNode, Watch  # noqa: E402

S = ExecutionState
Fly = navigation_actions.GotoStraight
NUMBERS = itertools.count()


class Goto(ActionSkill, AbstractGotoStraightSkill):
    """As short as it can be."""

    action, server, answer_s, silence_s, resumable = Fly, "fly", 1.0, 1.0, True
    results: ClassVar = {GoalStatus.STATUS_SUCCEEDED: "ARRIVED", GoalStatus.STATUS_ABORTED: "BLOCKED"}
    lost = "ABORTED"


class Talkative(Goto):
    """Goes wrong in what it overrides."""

    server = "fly"
    silence_s = 0.0

    def ending(self, execution, status, answer):
        """Raise."""
        raise ValueError("this end is not understood")


class Quiet(Goto):
    """Needs no feedback, and has no result for a lost server."""

    silence_s, lost = 0.0, ""


class Ask(ServiceSkill, AbstractGotoStraightSkill):
    """A service that can be stopped."""

    service, server, answer_s = SetBool, "ask", 1.0
    stop_service, stop_server = Trigger, "ask/stop"
    results: ClassVar = {True: "ARRIVED", False: "BLOCKED"}
    lost = "ABORTED"

    def request(self, inputs):
        """Ask by the speed."""
        return SetBool.Request(data=inputs.speed > 0.0)


class Patient(Ask):
    """Waits for longer than it takes to ask again."""

    answer_s = 10.0


class Awaited:
    """What a coroutine of a node awaits, and the test sets."""

    def __init__(self, node) -> None:
        self._node, self.future = node, Future()

    def set(self, value) -> None:
        self.future.set_result(value)
        self._node.executor.wake()


class FlyServer:
    """An action's server that does what the test says."""

    def __init__(self, spinning) -> None:
        self.node = spinning.spin(Node(f"flying_{next(NUMBERS)}"))
        self.goals: list = []
        self.cancels = 0
        self.accepts = True
        self.server = self.serve()

    def serve(self):
        return ActionServer(
            self.node,
            Fly,
            "fly",
            self._execute,
            callback_group=ReentrantCallbackGroup(),
            goal_callback=lambda _: GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT,
            cancel_callback=self._cancel,
        )

    async def _execute(self, handle):
        end = Awaited(self.node)
        self.goals.append(SimpleNamespace(handle=handle, request=handle.request, end=end.set))
        how, message = await end.future
        getattr(handle, how)()
        return Fly.Result(message=message)

    def leave(self):
        """Take the server away; the executor lets go of it when it wakes."""
        server, self.server = self.server, None
        if server is not None:
            server.destroy()
            self.node.executor.wake()

    def _cancel(self, _handle):
        self.cancels += 1
        return CancelResponse.ACCEPT

    def goal(self, number=0):
        until(lambda: len(self.goals) > number, f"goal {number} is there")
        return self.goals[number]


class Rig:
    """The managers with one kind of hooks for ``goto_straight``, and a client."""

    def __init__(self, spinning, kind) -> None:
        self.hooks = None

        def make(node):
            self.hooks = kind(Watch(node))
            return {skill.name: NavigationRecorder() for skill in SKILLSET.skills} | {"goto_straight": self.hooks}

        spinning.spin(SkillsetNode(SKILLSET, navigation_actions, make))
        self.node = spinning.spin(Node(f"function_tester_{next(NUMBERS)}"))
        self.client = SkillsetClient(self.node, "navigation")
        assert self.client.wait_ready(READY_S)
        for resource, state in FLYING.items():
            take(self.node, resource, state)

    def start(self, speed=2.0):
        handle = self.client.start("goto_straight", target=(1, 2, 3), speed=speed)
        until(lambda: handle.state is not S.REQUESTED, "it has started")
        return handle

    def ended(self, handle):
        assert handle.wait(SOON_S)
        return handle.state, handle.result, handle.message


@pytest.fixture
def rig(request, spinning):
    return Rig(spinning, request.param)


@pytest.fixture
def flying(spinning):
    server = FlyServer(spinning)
    yield server
    server.leave()


def hooked(*kinds):
    return pytest.mark.parametrize("rig", kinds, indirect=True, ids=[kind.__name__ for kind in kinds])


# --- an action ------------------------------------------------------------------------------------------------------------


@hooked(Quiet)
def test_a_goal_is_filled_followed_and_ends_by_the_table(flying, rig):
    handle = rig.start()
    goal = flying.goal()
    assert (goal.request.target.y, goal.request.speed) == (2.0, 2.0)

    def told():
        goal.handle.publish_feedback(Fly.Feedback(progress=0.25))
        return handle.progress == 0.25

    until(told, "its feedback is the skill's progress")
    goal.end(("succeed", "there"))
    assert rig.ended(handle) == (S.TERMINATED, "ARRIVED", "there")
    handle = rig.start()
    flying.goal(1).end(("abort", "a wall"))
    assert rig.ended(handle) == (S.TERMINATED, "BLOCKED", "a wall")


@hooked(Quiet)
def test_an_interruption_is_done_when_the_server_says_that_the_goal_is_over(flying, rig):
    handle = rig.start()
    goal = flying.goal()
    handle.interrupt()
    until(lambda: flying.cancels == 1, "the goal is cancelled")
    until(lambda: handle.state is S.INTERRUPTING, "that is told")
    assert rig.client.resources["axes_authority"] == "USED"
    goal.end(("canceled", ""))
    assert rig.ended(handle)[0] is S.INTERRUPTED


@hooked(Goto)
def test_a_broken_invariant_cancels_the_goal(flying, rig):
    handle = rig.start()
    flying.goal()
    take(rig.node, "SDK_authority", "UNAVAILABLE")
    assert rig.ended(handle)[:2] == (S.RESOURCE_INVARIANT_VIOLATED, "keep_sdk_authority")
    until(lambda: flying.cancels == 1, "the goal is cancelled")
    flying.goals[0].end(("canceled", ""))


@hooked(Quiet)
def test_a_pause_cancels_the_goal_and_its_end_sends_it_again(flying, rig):
    handle = rig.start()
    first = flying.goal()
    handle.pause()
    until(lambda: flying.cancels == 1, "the goal is cancelled")
    first.end(("canceled", ""))
    until(lambda: handle.state is S.PAUSED, "it is paused")
    handle.resume()
    second = flying.goal(1)
    assert second.request == first.request
    second.end(("succeed", ""))
    assert rig.ended(handle)[:2] == (S.TERMINATED, "ARRIVED")


@hooked(Goto)
def test_a_server_that_is_absent_refuses_or_falls_silent_is_lost(spinning, rig):
    assert rig.ended(rig.start()) == (S.TERMINATED, "ABORTED", "fly is not there")
    flying = FlyServer(spinning)
    flying.accepts = False
    assert rig.ended(rig.start()) == (S.TERMINATED, "ABORTED", "fly refuses the goal")
    flying.accepts = True
    assert rig.ended(rig.start()) == (S.TERMINATED, "ABORTED", "fly sends no feedback for 1 s")
    until(lambda: flying.cancels == 1, "a goal of a silent server is cancelled")
    flying.goal().end(("canceled", ""))
    flying.leave()


@hooked(Quiet)
def test_a_server_that_leaves_fails_the_skill_where_no_result_says_that(flying, rig):
    handle = rig.start()
    flying.goal()
    flying.leave()
    assert rig.ended(handle) == (S.FAILED, "", "fly is gone")


@hooked(Talkative)
def test_a_hook_that_raises_on_the_executor_ends_its_execution_only(flying, rig):
    for number in range(2):
        handle = rig.start()
        flying.goal(number).end(("succeed", ""))
        state, _, message = rig.ended(handle)
        assert (state, "this end is not understood" in message) == (S.FAILED, True)


# --- a service ------------------------------------------------------------------------------------------------------------


class AskServer:
    """A service that answers when the test says, and the one that stops it; of this, the first answers are lost."""

    def __init__(self, spinning, loses_stops=0) -> None:
        self.node = spinning.spin(Node(f"asked_{next(NUMBERS)}"))
        self.answers: list = []
        self.stops = 0
        self.loses_stops = loses_stops
        group = ReentrantCallbackGroup()
        self.service = self.node.create_service(SetBool, "ask", self._ask, callback_group=group)
        self.stop = self.node.create_service(Trigger, "ask/stop", self._stop, callback_group=group)

    async def _ask(self, request, response):
        answer = Awaited(self.node)
        self.answers.append(answer.set)
        response.success, response.message = request.data, await answer.future
        return response

    async def _stop(self, _request, response):
        self.stops += 1
        if self.stops <= self.loses_stops:
            await Future()
        response.success = True
        return response

    def asked(self, number=0):
        until(lambda: len(self.answers) > number, f"question {number} is there")
        return self.answers[number]


@hooked(Ask)
def test_an_answer_ends_it_by_the_table_and_an_interruption_calls_the_stop(spinning, rig):
    assert rig.ended(rig.start()) == (S.TERMINATED, "ABORTED", "ask is not there")
    asked = AskServer(spinning)
    handle = rig.start()
    asked.asked()("yes")
    assert rig.ended(handle) == (S.TERMINATED, "ARRIVED", "yes")
    handle = rig.start(speed=-1.0)
    asked.asked(1)("no")
    assert rig.ended(handle) == (S.TERMINATED, "BLOCKED", "no")
    handle = rig.start()
    asked.asked(2)
    before = asked.stops  # what ran before is stopped, too, where the service that does it was found first
    handle.interrupt()
    assert rig.ended(handle)[0] is S.INTERRUPTED
    assert asked.stops == before + 1
    late = rig.start()
    asked.asked(3)
    assert rig.ended(late) == (S.TERMINATED, "ABORTED", "ask does not answer for 1 s")
    asked.answers[2]("late")
    asked.answers[3]("late")


# --- managers that start where others have left something running ---------------------------------------------------------


def test_managers_that_start_cancel_what_ran_before_and_are_there_then(spinning, flying):
    before = ActionClient(spinning.spin(Node(f"before_{next(NUMBERS)}")), Fly, "fly")
    assert before.wait_for_server(SOON_S)
    before.send_goal_async(Fly.Goal())
    goal = flying.goal()
    rig = Rig(spinning, Quiet)
    assert flying.cancels == 1
    goal.end(("canceled", ""))
    handle = rig.start()
    flying.goal(1).end(("succeed", ""))
    assert rig.ended(handle)[:2] == (S.TERMINATED, "ARRIVED")


def test_managers_that_start_call_the_stop_of_a_service(spinning):
    asked = AskServer(spinning)
    Rig(spinning, Ask)
    assert asked.stops == 1


def test_a_service_whose_first_answer_is_lost_is_asked_to_stop_again(spinning):
    asked = AskServer(spinning, loses_stops=1)
    Rig(spinning, Patient)
    assert asked.stops == 2


def test_a_late_service_whose_first_answer_is_lost_is_asked_to_stop_again(spinning):
    rig = Rig(spinning, Patient)
    asked = AskServer(spinning, loses_stops=1)
    handle = rig.start()
    asked.asked()("there")
    assert rig.ended(handle)[:2] == (S.TERMINATED, "ARRIVED")
    assert asked.stops == 2


def test_a_stop_whose_server_comes_after_the_managers_is_called_before_anything_is_asked(spinning):
    rig = Rig(spinning, Ask)
    asked = AskServer(spinning)
    until(lambda: asked.stops == 1, "what ran before is stopped")
    handle = rig.start()
    until(lambda: len(asked.answers) == 1, "it is asked")
    asked.answers[0]("there")
    assert rig.ended(handle)[:2] == (S.TERMINATED, "ARRIVED")
    assert asked.stops == 1


def test_an_action_whose_server_comes_after_the_managers_is_sent_goals_once_it_has_cancelled_what_ran_before(spinning):
    rig = Rig(spinning, Quiet)
    server = FlyServer(spinning)
    try:
        handle = rig.start()
        server.goal().end(("succeed", ""))
        assert rig.ended(handle)[:2] == (S.TERMINATED, "ARRIVED")
        assert (server.cancels, rig.hooks.stops_first) == (0, False)
    finally:
        server.leave()


# --- what is wrong in the class -------------------------------------------------------------------------------------------


def test_a_result_that_the_model_has_not_is_told_when_the_hooks_are_made():
    class Wrong(Goto):
        results: ClassVar = {GoalStatus.STATUS_SUCCEEDED: "ARIVED"}

    with pytest.raises(SkillRuntimeError, match="Wrong: its skill has no result ARIVED; the model has ABORTED, ARRIVED, BLOCKED"):
        Wrong(SimpleNamespace(every=lambda _: None))
    assert Ending("ARRIVED").outputs == {}
