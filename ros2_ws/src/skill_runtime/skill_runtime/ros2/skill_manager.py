"""A skill manager (paper, section 4.2): one skill as a ROS 2 action.

A goal is always accepted and every end of the execution is its result, so that the caller always gets the reason. No
thread and no coroutine waits while a skill runs (in rclpy 7.1.6 an awaiting coroutine is resumed at every turn of the
executor): the goal's handle is kept, and its result is set when the engine tells of the end.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Protocol

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import GoalEvent, RCLError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from skill_model.execution_state import ExecutionState
from skill_model.model import Skill, Skillset
from skill_runtime.core.events import ExecutionEvent
from skill_runtime.core.execution import Execution
from skill_runtime.hooks import SkillHooks
from skill_runtime.ros2.convert import fill, values_of
from skill_runtime.ros2.names import GOALS

Job = Callable[[], object]
ID_DIGITS = 12
RESULT_KEPT_S = 3.0
"""How long who asks late still gets a result. Each status message names every goal that is kept: many in a row cost by their number."""


def execution_id(goal_id: Any) -> str:
    """Return the execution's id of an action's goal: the first 12 hexadecimal digits of the goal's UUID."""
    return bytes(goal_id.uuid).hex()[:ID_DIGITS]


class Engine(Protocol):
    """What a skill manager needs of the engine, or of its image when that is in another process."""

    skillset: Skillset

    def register(self, skill: str, inputs: object, *, execution_id: str = "") -> Execution:
        """Take down a request."""
        ...

    def run(self, execution_id: str, submit: Callable[[Job], None]) -> None:
        """Have a registered request validated and started; ``submit`` runs hooks that may wait."""
        ...

    def interrupt(self, execution_id: str) -> bool:
        """Ask for the end of an execution."""
        ...

    def execution(self, execution_id: str) -> Execution | None:
        """Return one that has not ended."""
        ...

    def progress(self, execution_id: str) -> float | None:
        """Ask how far an execution is; None when it is not running."""
        ...


class SkillManager:
    """Serves one skill; ``submit`` runs a job on a thread of its own, because hooks may wait."""

    def __init__(
        self,
        node: Node,
        engine: Engine,
        skill: Skill,
        action: Any,
        hooks: SkillHooks,
        submit: Callable[[Job], None],
    ) -> None:
        self._node = node
        self._engine = engine
        self._skill = skill
        self._action = action
        self._hooks = hooks
        self._submit = submit
        self._goals: dict[str, Any] = {}
        self._server = ActionServer(
            node,
            action,
            f"{engine.skillset.name}/skill/{skill.name}",
            execute_callback=self._unexpected,
            goal_callback=lambda _: GoalResponse.ACCEPT,
            handle_accepted_callback=self._accepted,
            cancel_callback=self._cancel,
            callback_group=MutuallyExclusiveCallbackGroup(),
            goal_service_qos_profile=GOALS,
            result_service_qos_profile=GOALS,
            cancel_service_qos_profile=GOALS,
            result_timeout=RESULT_KEPT_S,
        )
        self._timer: Any = None
        if skill.progress is not None:
            self._timer = node.create_timer(skill.progress.period_s, self._report, autostart=False)

    def on_event(self, event: ExecutionEvent) -> None:
        """Follow an execution of this skill."""
        goal = self._goals.get(event.id)
        if goal is None:
            return
        if event.state.active:
            execution = self._engine.execution(event.id)
            self._feed_back(goal, 0.0 if execution is None else execution.progress, event.state, event.outputs)
        if event.state.terminal:
            del self._goals[event.id]
            # Goals change state in the executor's thread only, where also cancel requests are handled.
            self._server.notify_execute(goal, lambda goal: self._finish(goal, event))

    def _accepted(self, goal: Any) -> None:
        # Not `goal.execute()`, which would demand the result at once; the state belongs on the action's status topic.
        goal._update_state(GoalEvent.EXECUTE)  # noqa: SLF001
        identifier = execution_id(goal.goal_id)
        self._goals[identifier] = goal
        if self._timer is not None and self._timer.is_canceled():
            self._timer.reset()
        # Registered here, in the thread that also gets cancel requests: none finds its execution unknown.
        try:
            self._engine.register(self._skill.name, self._hooks.make_inputs(values_of(goal.request)), execution_id=identifier)
        except Exception as error:  # noqa: BLE001 - inputs are made by the developer's class
            self._refuse(goal, identifier, f"the request could not be taken down: {type(error).__name__}: {error}")
            return
        self._engine.run(identifier, self._submit)

    def _refuse(self, goal: Any, identifier: str, message: str) -> None:
        """End a goal that never became an execution."""
        del self._goals[identifier]
        failed = ExecutionEvent(0, 0, self._skill.name, identifier, ExecutionState.FAILED, "", message, None, {})
        self._server.notify_execute(goal, lambda goal: self._finish(goal, failed))

    def _cancel(self, goal: Any) -> Any:
        self._submit(lambda: self._engine.interrupt(execution_id(goal.goal_id)))
        return CancelResponse.ACCEPT

    def _finish(self, goal: Any, event: ExecutionEvent) -> Any:
        """Set the goal's state and return its result."""
        result = self._action.Result(outcome=event.state.value, result=event.result, message=event.message)
        try:
            fill(result, event.outputs, f"outputs of {self._skill.name}")
        except ValueError as error:
            result.message = f"{result.message} ({error})".strip()
        try:
            if event.state is ExecutionState.TERMINATED:
                goal.succeed()
            elif event.state is ExecutionState.INTERRUPTED and goal.is_cancel_requested:
                goal.canceled()
            else:
                goal.abort()
        except RCLError as error:
            self._node.get_logger().warning(f"goal {event.id} of {self._skill.name}: {error}")
        return result

    @staticmethod
    def _unexpected(goal: Any) -> Any:
        raise RuntimeError(f"goal {execution_id(goal.goal_id)} was executed by somebody else")

    def _report(self) -> None:
        """Send the progress of all goals; stop the timer when there are none."""
        for identifier, goal in list(self._goals.items()):
            self._submit(functools.partial(self._report_goal, identifier, goal))
        if not self._goals:
            self._timer.cancel()

    def _report_goal(self, identifier: str, goal: Any) -> None:
        progress = self._engine.progress(identifier)
        execution = self._engine.execution(identifier)
        if progress is not None and execution is not None:
            self._feed_back(goal, progress, execution.state, dict(execution.outputs))

    def _feed_back(self, goal: Any, progress: float, state: ExecutionState, outputs: Any) -> None:
        feedback = self._action.Feedback(progress=progress, state=state.value)
        try:
            fill(feedback, outputs, f"outputs of {self._skill.name}")
        except ValueError as error:
            self._node.get_logger().error(str(error))
        goal.publish_feedback(feedback)
