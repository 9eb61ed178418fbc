"""A skill manager (paper, section 4.2): one skill as an actionlib action that takes any number of goals at a time.

A goal's id is the execution's. It is PENDING until the skill runs, so a refusal is a REJECTED goal and an interruption before
the start a RECALLED one; every end carries a result that says why. No thread waits while a skill runs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import rospy
from actionlib import ActionServer, ServerGoalHandle
from actionlib_msgs.msg import GoalStatus
from std_msgs.msg import Header

from skill_model.execution_state import ExecutionState
from skill_model.model import Skill
from skill_runtime.core.engine import SkillsetEngine
from skill_runtime.core.events import ExecutionEvent
from skill_runtime.hooks import SkillHooks
from skillset_ros1.alarms import Alarms
from skillset_ros1.convert import fill, values_of
from skillset_ros1.names import ActionTypes

Job = Callable[[], object]
OnGoal = Callable[[ServerGoalHandle], None]
OnResult = Callable[[Any], None]
RECALLED_EARLY = "interrupted before it arrived"
RESULTS_KEPT = 10
_WAITING = {GoalStatus.PENDING, GoalStatus.RECALLING}


class _Server(ActionServer, rospy.SubscribeListener):  # type: ignore[misc]  # neither actionlib nor rospy has types
    """An action server whose results reach everybody and are never empty.

    A subscriber of ROS 1 takes itself for connected a moment before the publisher knows of it, so an action client can lose the
    result of its first goal: who subscribes is sent the last results. And actionlib itself recalls a goal whose cancellation came
    first, without a word.
    """

    def __init__(self, name: str, spec: Any, on_goal: OnGoal, on_cancel: OnGoal) -> None:
        self._results: deque[Any] = deque(maxlen=RESULTS_KEPT)
        super().__init__(name, spec, on_goal, on_cancel, auto_start=False)

    def initialize(self) -> None:
        """Make the topics."""
        super().initialize()
        self.result_pub.impl.add_subscriber_listener(self)

    def publish_result(self, status: Any, result: Any) -> None:
        """Publish a result."""
        if not result.outcome:
            result.outcome, result.message = ExecutionState.INTERRUPTED.value, RECALLED_EARLY
        with self.lock:
            self._results.append(self.ActionResult(Header(stamp=rospy.get_rostime()), status, result))
            super().publish_result(status, result)

    def peer_subscribe(self, topic_name: str, topic_publish: OnResult, peer_publish: OnResult) -> None:  # noqa: ARG002
        """Send the last results to somebody who has just subscribed."""
        with self.lock:
            for result in self._results:
                peer_publish(result)


class SkillManager:
    """Serves one skill; ``submit`` runs a job on a thread of its own, because hooks may wait."""

    def __init__(
        self,
        place: str,
        engine: SkillsetEngine,
        skill: Skill,
        types: ActionTypes,
        hooks: SkillHooks,
        submit: Callable[[Job], None],
        alarms: Alarms,
    ) -> None:
        self._engine = engine
        self._skill = skill
        self._types = types
        self._hooks = hooks
        self._submit = submit
        self._alarms = alarms
        self._goals: dict[str, ServerGoalHandle] = {}
        self._server = _Server(f"{place}/skill/{skill.name}", types.spec, self._accepted, self._cancel)

    def start(self) -> None:
        """Take goals."""
        self._server.start()

    def close(self) -> None:
        """Take no more goals, and take the topics away."""
        self._server.stop()

    def on_event(self, event: ExecutionEvent) -> None:
        """Follow an execution of this skill."""
        handle = self._goals.get(event.id)
        if handle is None:
            return
        if event.state.active:
            if handle.get_goal_status().status in _WAITING:
                handle.set_accepted()
                self._report_later(event.id)
            execution = self._engine.execution(event.id)
            self._feed_back(handle, 0.0 if execution is None else execution.progress, event.state, event.outputs)
        elif event.state.terminal:
            del self._goals[event.id]
            self._finish(handle, event)

    def _accepted(self, handle: ServerGoalHandle) -> None:
        identifier = handle.get_goal_id().id
        self._goals[identifier] = handle
        # Registered here, with the server's lock held: no cancellation finds its execution unknown.
        try:
            self._engine.register(self._skill.name, self._hooks.make_inputs(values_of(handle.get_goal())), execution_id=identifier)
        except Exception as error:  # noqa: BLE001 - inputs are made by the developer's class
            del self._goals[identifier]
            reason = f"the request could not be taken down: {type(error).__name__}: {error}"
            handle.set_rejected(self._types.result(outcome=ExecutionState.FAILED.value, message=reason), reason)
            return
        self._submit(lambda: self._engine.run(identifier))

    def _cancel(self, handle: ServerGoalHandle) -> None:
        identifier = handle.get_goal_id().id
        self._submit(lambda: self._engine.interrupt(identifier))

    def _finish(self, handle: ServerGoalHandle, event: ExecutionEvent) -> None:
        """Set the goal's terminal state and send its result."""
        result = self._types.result(outcome=event.state.value, result=event.result, message=event.message)
        try:
            fill(result, event.outputs, f"outputs of {self._skill.name}")
        except ValueError as error:
            result.message = f"{result.message} ({error})".strip()
        waiting = handle.get_goal_status().status in _WAITING
        if event.state is ExecutionState.TERMINATED:
            handle.set_succeeded(result, event.message)
        elif event.state is ExecutionState.INTERRUPTED:
            handle.set_canceled(result, event.message)
        elif waiting:
            handle.set_rejected(result, event.message)
        else:
            handle.set_aborted(result, event.message)

    def _report_later(self, identifier: str) -> None:
        if self._skill.progress is not None:
            self._alarms.after(self._skill.progress.period_s, lambda: self._submit(lambda: self._report(identifier)))

    def _report(self, identifier: str) -> None:
        """Send the progress of a goal, and again after a period; not before the hook has answered."""
        progress = self._engine.progress(identifier)
        handle, execution = self._goals.get(identifier), self._engine.execution(identifier)
        if handle is None or execution is None:
            return
        if progress is not None:
            self._feed_back(handle, progress, execution.state, dict(execution.outputs))
        self._report_later(identifier)

    def _feed_back(self, handle: ServerGoalHandle, progress: float, state: ExecutionState, outputs: Any) -> None:
        feedback = self._types.feedback(progress=progress, state=state.value)
        try:
            fill(feedback, outputs, f"outputs of {self._skill.name}")
        except ValueError as error:
            rospy.logerr("%s", error)
        handle.publish_feedback(feedback)
