"""Follows one goal from its sending to its end, whatever message gets lost on the way.

A DDS service may answer before it has discovered who asked: the answer is lost (rclpy 7.1.6 then warns of a "client [that]
will not receive response"), and rclpy's action client also drops answers that overtake its own bookkeeping. So the goal's
answer and its result are believed when they come, and the events of the skillset, which are latched and reliable, otherwise.
"""

from __future__ import annotations

import json
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.action.client import ClientGoalHandle
from unique_identifier_msgs.msg import UUID

from skill_model.execution_state import ExecutionState
from skill_runtime.handle import SkillHandle
from skill_runtime.ros2.convert import fields_of, fill
from skill_runtime.ros2.skill_manager import execution_id
from skill_runtime.waiting import Host, Pending

ACKNOWLEDGE_TIMEOUT_S = 5.0
"""Managers acknowledge any goal at once; no sign for so long (wall clock) means that there will be none."""
SILENCE_LIMIT_S = 10.0
"""A skill manager in a process of its own may die between taking a goal and asking for it: then no event ever tells of it."""
RESULT_GRACE_S = 0.5
"""The event of an end waits so long for the result: who has it has seen the resources after the step, too."""

_FEEDBACK_FIELDS = ("progress", "state")
_RESULT_FIELDS = ("outcome", "result", "message")


class Pursuit:
    """One goal of an action; ``handle`` is what the caller gets."""

    def __init__(
        self,
        skillset: str,
        skill: str,
        action: Any,
        client: Any,
        *,
        pause: Callable[[str, bool], Pending[str]] | None = None,
        host: Host | None = None,
    ) -> None:
        identifier = UUID(uuid=list(uuid.uuid4().bytes))
        name = execution_id(identifier)
        pausing = None if pause is None else lambda paused: pause(name, paused)
        self.handle = SkillHandle(skill, name, self._interrupt, pause=pausing, host=host)
        self._skillset = skillset
        self._action = action
        self._client = client
        accepted = action.Impl.SendGoalService.Response(accepted=True)
        self._goal = ClientGoalHandle(client, identifier, accepted)
        self._lock = threading.Lock()
        self._sent_s = time.monotonic()
        self._acknowledged = False
        self._heard = False
        self._interrupt_wanted = False
        self._last_event: tuple[float, Any] | None = None

    def send(self, goal: Any) -> None:
        """Send the goal."""
        answer = self._client.send_goal_async(goal, self._on_feedback, self._goal.goal_id)
        answer.add_done_callback(self._on_answer)

    @property
    def restless(self) -> bool:
        """Tell whether ``tick`` has to be called."""
        return not (self._acknowledged and self._heard) or self._last_event is not None

    def tick(self) -> None:
        """End what did not get its answer in time."""
        now = time.monotonic()
        if self._last_event is not None and now - self._last_event[0] > RESULT_GRACE_S:
            self._end_by_event(self._last_event[1])
        elif not self._acknowledged and now - self._sent_s > ACKNOWLEDGE_TIMEOUT_S:
            self.handle.fail(f"the managers of {self._skillset} did not answer within {ACKNOWLEDGE_TIMEOUT_S:g} s")
        elif not self._heard and now - self._sent_s > SILENCE_LIMIT_S:
            self._goal.cancel_goal_async()
            self.handle.fail(f"the managers of {self._skillset} took the goal, and told nothing of it within {SILENCE_LIMIT_S:g} s")

    def ask_again(self) -> None:
        """Ask for the result once more; who does not know the goal answers at once."""
        if self._acknowledged:
            self._goal.get_result_async().add_done_callback(self._on_result)

    def abandon(self, reason: str) -> None:
        """End because the managers have gone: as they last said, or else as FAILED for this reason."""
        if self._last_event is not None:
            self._end_by_event(self._last_event[1])
        self.handle.fail(reason)

    def on_event(self, event: Any) -> None:
        """Take an event of this execution."""
        self._heard = True
        self._acknowledge()
        state = ExecutionState(event.state)
        if state.terminal:
            self._last_event = (time.monotonic(), event)
        elif state is not ExecutionState.REQUESTED:
            self.handle.enter(state)

    def _on_answer(self, future: Any) -> None:
        answer = future.result()
        if answer is not None and answer.accepted:
            self._acknowledge()
        elif not self._acknowledged:
            self.handle.fail(f"the managers of {self._skillset} did not take the goal")

    def _acknowledge(self) -> None:
        """Ask for the result, and for the interruption if it was wanted before, once."""
        with self._lock:
            if self._acknowledged:
                return
            self._acknowledged = True
            interrupt = self._interrupt_wanted
        self._goal.get_result_async().add_done_callback(self._on_result)
        if interrupt:
            self._goal.cancel_goal_async()

    def _interrupt(self) -> None:
        with self._lock:
            self._interrupt_wanted = True
            now = self._acknowledged
        if now:
            self._goal.cancel_goal_async()

    def _on_feedback(self, message: Any) -> None:
        feedback = message.feedback
        self._heard = True
        self._acknowledge()
        self.handle.run(feedback.progress, {name: getattr(feedback, name) for name in fields_of(feedback) if name not in _FEEDBACK_FIELDS})

    def _on_result(self, future: Any) -> None:
        result = None if future.result() is None else future.result().result
        if result is None or not result.outcome:
            self.handle.fail(f"the managers of {self._skillset} do not know this execution; were they started anew?")
        else:
            self._end_by_result(ExecutionState(result.outcome), result)

    def _end_by_event(self, event: Any) -> None:
        outputs = outputs_of(self._action, json.loads(event.outputs_json or "{}"), self.handle.skill)
        self.handle.end(ExecutionState(event.state), event.result, event.message, outputs)

    def _end_by_result(self, state: ExecutionState, result: Any) -> None:
        outputs = {name: getattr(result, name) for name in fields_of(result) if name not in _RESULT_FIELDS}
        self.handle.end(state, result.result, result.message, outputs)


def outputs_of(action: Any, plain: Mapping[str, object], skill: str) -> dict[str, Any]:
    """Return outputs as the action's result carries them, from the plain values of an event."""
    values = {name: value for name, value in plain.items() if value is not None}
    result = fill(action.Result(), values, f"outputs of {skill}")
    return {name: getattr(result, name) for name in fields_of(result) if name not in _RESULT_FIELDS}
