"""Skills as ROS 2 actions: the server is rclpy's, the client speaks to its services and its feedback topic itself.

So a client asks again for what got lost, with the same goal id, and needs no status messages; its results it hears by the events.
"""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Mapping
from typing import Any

from action_msgs.msg import GoalInfo
from action_msgs.srv import CancelGoal
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import GoalEvent, RCLError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from unique_identifier_msgs.msg import UUID

from alula.model.execution_state import ExecutionState
from alula.runtime.action_messages import ActionMessages
from alula.runtime.core.events import ExecutionEvent
from alula.runtime.middleware import CALL_S, Goal, GoalListener, OnError, OnValue
from skillset_ros2.base import ID_DIGITS, RclpyBase
from skillset_ros2.calls import Calls, Discovery, Withdraw
from skillset_ros2.convert import TYPES, ros_types
from skillset_ros2.names import SERVICE

UUID_BYTES = 16
RESULTS_KEPT_S = 900
"""How long after an execution's end (mission clock) its result can be asked for: rclpy's own default, whatever rcl's is."""
GOAL_S = 60.0
"""How long a goal is offered to managers that don't answer; the client gives up before."""


def action_messages(base: RclpyBase, action: Any, skill: str) -> ActionMessages:
    """Return what makes and reads the messages of an action."""
    return ActionMessages(skill, TYPES, goal=action.Goal, feedback=action.Feedback, result=action.Result, on_error=base.log)


def execution_id(goal_id: Any) -> str:
    """Return the execution's id of an action's goal: the first 12 hexadecimal digits of the goal's UUID."""
    return bytes(goal_id.uuid).hex()[:ID_DIGITS]


class RclpyGoal:
    """A goal at its server."""

    def __init__(self, server: RclpyServer, handle: Any) -> None:
        self.id = execution_id(handle.goal_id)
        self.inputs: Mapping[str, object] = server.messages.read_goal(handle.request)
        self._server = server
        self._handle = handle

    def report(self, progress: float, state: ExecutionState, outputs: Mapping[str, object]) -> None:
        """Publish progress (0 to 1), state and outputs as the action's feedback."""
        self._handle.publish_feedback(self._server.messages.make_feedback(progress, state, outputs))

    def finish(self, event: ExecutionEvent) -> None:
        """Set the goal's state and send its result, on the executor: goals change state there only."""
        self._server.finish(self._handle, event)


class RclpyServer:
    """A skill's action at its manager. Every goal is accepted: how its execution ends is its result."""

    def __init__(self, base: RclpyBase, action: Any, skill: str, on_goal: Callable[[Goal], None], on_cancel: Callable[[str], None]) -> None:
        self.messages = action_messages(base, action, skill)
        self.inputs_of = self.messages.inputs_of
        self._base = base
        self._skill = skill
        self._on_goal = on_goal
        self._on_cancel = on_cancel
        self._server = ActionServer(
            base.node,
            action,
            base.name(f"skill/{skill}"),
            execute_callback=_unexpected,
            goal_callback=lambda _: GoalResponse.ACCEPT,
            handle_accepted_callback=base.on_loop(self._accepted),
            cancel_callback=base.on_loop(self._cancel),
            callback_group=MutuallyExclusiveCallbackGroup(),
            goal_service_qos_profile=SERVICE,
            result_service_qos_profile=SERVICE,
            cancel_service_qos_profile=SERVICE,
            result_timeout=RESULTS_KEPT_S,
        )

    def finish(self, handle: Any, event: ExecutionEvent) -> None:
        """Have the server answer with the result that an execution's terminal event makes."""
        self._server.notify_execute(handle, lambda goal: self._result(goal, event))

    def _accepted(self, handle: Any) -> None:
        # Not `handle.execute()`, which would demand the result at once; the state belongs on the action's status topic.
        handle._update_state(GoalEvent.EXECUTE)  # noqa: SLF001
        self._on_goal(RclpyGoal(self, handle))

    def _cancel(self, handle: Any) -> Any:
        self._on_cancel(execution_id(handle.goal_id))
        return CancelResponse.ACCEPT

    def _result(self, handle: Any, event: ExecutionEvent) -> Any:
        """Set the goal's state and return its result."""
        result = self.messages.make_result(event)
        try:
            if event.state is ExecutionState.TERMINATED:
                handle.succeed()
            elif event.state is ExecutionState.INTERRUPTED and handle.is_cancel_requested:
                handle.canceled()
            else:
                handle.abort()
        except RCLError as error:
            self._base.log(f"goal {event.id} of {self._skill}: {error}")
        return result


class RclpyLink:
    """A skill's action at a client; the executor waits for it only while something is awaited of it."""

    def __init__(self, base: RclpyBase, action: Any, skill: str, listener: GoalListener) -> None:
        self._base = base
        self._action = action
        self._skill = skill
        self._messages = action_messages(base, action, skill)
        self.fit, self.outputs_of = self._messages.fit, self._messages.outputs_of
        self._listener = listener
        self._lock = threading.Lock()
        self._goals: dict[str, Any] = {}
        self._offers: dict[str, Withdraw] = {}
        place = f"skill/{skill}/_action"
        self._send = base.calls(f"{place}/send_goal", action.Impl.SendGoalService)
        self._discovered = Discovery(lambda: self._send.ready)
        self._follow = base.resting_subscription(f"{place}/feedback", action.Impl.FeedbackMessage, self._on_feedback)

    @functools.cached_property
    def _cancels(self) -> Calls:
        return self._base.calls(f"skill/{self._skill}/_action/cancel_goal", CancelGoal)

    @functools.cached_property
    def _results(self) -> Calls:
        return self._base.calls(f"skill/{self._skill}/_action/get_result", self._action.Impl.GetResultService)

    @property
    def connected(self) -> bool:
        """Return whether the action is there; its other services are met when they are used first."""
        return self._discovered()

    @property
    def input_types(self) -> dict[str, str]:
        """The inputs with their types."""
        return ros_types(self._action.Goal)

    def send(self, goal_id: str, goal: Any, on_answer: Callable[[bool], None]) -> None:
        """Send a goal; ``on_answer`` gets whether it was accepted."""
        identifier = UUID(uuid=list(bytes.fromhex(goal_id) + os.urandom(UUID_BYTES - ID_DIGITS // 2)))
        with self._lock:
            self._goals[goal_id] = identifier
            self._follow(True)

        def answered(response: Any, tries: int) -> None:
            self._offers.pop(goal_id, None)
            # Managers that are offered a goal twice refuse the second offer; the first may have been taken.
            if response.accepted or tries == 1:
                on_answer(bool(response.accepted))

        request = self._action.Impl.SendGoalService.Request(goal_id=identifier, goal=goal)
        self._offers[goal_id] = self._send.call(request, answered, _nothing, timeout_s=GOAL_S, once=False)
        _ = self._cancels  # met by the time that it is wanted

    def cancel(self, goal_id: str) -> None:
        """Ask for the interruption of a goal that was sent here."""
        identifier = self._goals.get(goal_id)
        if identifier is not None:
            request = CancelGoal.Request(goal_info=GoalInfo(goal_id=identifier))
            self._cancels.call(request, lambda *_: None, _nothing, timeout_s=CALL_S, once=False)

    def cancel_all(self, on_count: OnValue, on_error: OnError) -> None:
        """Cancel all goals: a goal of zeros at a time of zero (action_msgs/srv/CancelGoal)."""
        counted = lambda response, _: on_count(len(response.goals_canceling))  # noqa: E731
        self._cancels.call(CancelGoal.Request(), counted, on_error, timeout_s=CALL_S, once=False)

    def request_result(self, goal_id: str) -> None:
        """Ask for a goal's result; managers that do not know the goal answer at once."""
        identifier = self._goals.get(goal_id)
        if identifier is None:
            return

        def answered(response: Any, _: int) -> None:
            known = self._messages.read_result(response.result) if response.result.outcome else None
            self._listener.on_result(goal_id, known)

        self._results.call(self._action.Impl.GetResultService.Request(goal_id=identifier), answered, _nothing, timeout_s=GOAL_S, once=True)

    def release(self, goal_id: str) -> None:
        """Stop following a goal and stop offering it: restarted managers would take it for a new one."""
        withdraw = self._offers.pop(goal_id, None)
        if withdraw is not None:
            withdraw()
        with self._lock:
            self._goals.pop(goal_id, None)
            if not self._goals:
                self._follow(False)

    def _on_feedback(self, message: Any) -> None:
        goal_id = execution_id(message.goal_id)
        if goal_id in self._goals:
            self._listener.on_feedback(goal_id, *self._messages.read_feedback(message.feedback))


def _nothing(reason: str) -> None:
    """Do nothing: the goal's own time-outs give it up."""


def _unexpected(handle: Any) -> Any:
    raise RuntimeError(f"goal {execution_id(handle.goal_id)} was executed elsewhere")
