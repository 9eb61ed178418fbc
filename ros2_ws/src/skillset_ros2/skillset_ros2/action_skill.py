"""The base of a skill whose function is a goal of an action's server."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal

from alula.runtime.core.execution import Execution
from alula.runtime.core.sanitize import error_line
from skillset_ros2.action_client import ActionClient
from skillset_ros2.function_skill import Call, Ending, FunctionSkill, filled, said_by
from skillset_ros2.watch import Watch

STATUS_NAMES = {
    GoalStatus.STATUS_SUCCEEDED: "SUCCEEDED",
    GoalStatus.STATUS_CANCELED: "CANCELED",
    GoalStatus.STATUS_ABORTED: "ABORTED",
}


@dataclass(eq=False)
class Goal(Call):
    """A goal of an execution."""

    client: Any = None
    request: Any = None
    sent: bool = False
    handle: Any = None
    """rclpy's, once the server has accepted the goal."""
    cancelled: bool = False
    """Whether it is to be cancelled; ``cancel_answered``: the server has received that, and stops in its own time."""
    cancel_answered: bool = False
    paused: bool = False
    ended: bool = False
    """Whether a paused goal is over."""
    progress: float = 0.0


class ActionSkill(FunctionSkill[Goal]):
    """A skill whose function is an action: sends a goal, follows its feedback, and ends as the goal ends.

    An interruption cancels the goal and waits until it is over.

    By default inputs fill the goal's fields of the same names, the feedback's ``progress`` (0 to 1) is the skill's, the goal's final status
    selects the result, and ``message`` of the server's result is the reason; override ``goal``, ``part_done`` and ``ending`` to change
    that.
    """

    action: ClassVar[Any]
    """The action's type."""
    results: ClassVar[Mapping[Any, str]] = {}
    """The result for each final status of a goal, as ``GoalStatus.STATUS_SUCCEEDED``."""
    silence_s: ClassVar[float] = 0.0
    """How long a goal that was accepted may be without feedback, mission clock; 0: it need not send any."""
    resumable: ClassVar[bool] = False
    """Whether a pause cancels the goal and its end sends it again."""

    def __init__(self, watch: Watch) -> None:
        super().__init__(watch)
        self._clients: dict[str, Any] = {}
        if self.server:
            self._client(self.server)

    # --- what a skill may change --------------------------------------------------------------------------------------

    def goal(self, inputs: Any) -> Any:
        """Return the goal."""
        return filled(self.action.Goal(), inputs, f"the goal of {self.server}")

    def part_done(self, execution: Execution, feedback: Any) -> float:
        """Return how far it is by this feedback, 0 to 1."""
        return float(getattr(feedback, "progress", execution.progress))

    def ending(self, execution: Execution, status: int, answer: Any) -> Ending:  # noqa: ARG002
        """Return how this final status, one of ``results``, and the server's result end the execution."""
        return Ending(self.results[status], said_by(answer))

    # --- hooks --------------------------------------------------------------------------------------------------------

    def on_start(self) -> None:
        """Cancel all goals of the server: those that earlier managers have sent may still run."""
        if self.server:
            self.call_at_start(CancelGoal, f"{self.server}/_action/cancel_goal", CancelGoal.Request())

    def on_dispatch(self, execution: Execution) -> None:
        """Send the goal, as soon as the server is there."""
        self._send_new(execution)

    def progress(self, execution: Execution) -> float:
        """Return how far it is by the last feedback."""
        goal = self._calls.get(execution.id)
        return execution.progress if goal is None else goal.progress

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Cancel the goal; the interruption is complete when the server reports the goal's end."""
        with self._lock:
            goal = self._calls.get(execution.id)
            if goal is None or goal.ended or not goal.sent:
                self.forget(execution)
                return None
            goal.stopping = True
            self._cancel(goal)
        return False

    def on_emergency(self, execution: Execution) -> None:
        """Stop waiting for the end of a goal that was cancelled."""
        goal = self.forget(execution)
        if goal is not None:
            self._cancel(goal)

    def on_pause(self, execution: Execution) -> str | None:
        """Cancel the goal where it may be sent again."""
        if not self.resumable:
            return super().on_pause(execution)
        with self._lock:
            goal = self._calls.get(execution.id)
            if goal is None:
                return "it has ended"
            goal.paused = True
            goal.ended = not goal.sent
            self._cancel(goal)
        return ""

    def on_resume(self, execution: Execution) -> str | None:
        """Send the goal again."""
        if execution.id not in self._calls:
            return "it has ended"
        self._send_new(execution)
        return ""

    # --- the goal -----------------------------------------------------------------------------------------------------

    def _client(self, server: str) -> Any:
        if server not in self._clients:
            self._clients[server] = ActionClient(self.watch.node, self.action, server)
        return self._clients[server]

    def _send_new(self, execution: Execution) -> None:
        server, request = self.server_for(execution.inputs), self.goal(execution.inputs)
        with self._lock:
            goal = Goal(execution, server, self.watch.now_s, client=self._client(server), request=request)
            self.begin(goal)

    def _send(self, goal: Goal) -> None:
        goal.sent, goal.since_s = True, self.watch.now_s
        sent = goal.client.send_goal_async(goal.request, lambda feedback: self._on_feedback(goal, feedback.feedback))
        sent.add_done_callback(lambda future: self._on_answer(goal, future.result()))

    def _cancel(self, goal: Goal) -> None:
        """Cancel a goal; one that is not accepted yet is cancelled when it is."""
        with self._lock:
            goal.cancelled, goal.since_s = True, self.watch.now_s
            if goal.handle is not None:
                goal.handle.cancel_goal_async().add_done_callback(lambda _: self._on_cancel_answered(goal))

    def look(self, call: Goal) -> str:
        """Send the goal once the server is there; return why it is lost, or ""."""
        if call.ended:
            return ""
        ready = call.client.server_is_ready()
        waited_s = self.waited_s(call)
        if not call.sent:
            if ready and not self.stops_first:
                self._send(call)
                return ""
            lost = "has not stopped what ran before" if ready else "is not there"
            return lost if waited_s > self.answer_s else ""
        if not ready:
            return "is gone"
        if call.handle is None or (call.cancelled and not call.cancel_answered):
            return f"does not answer for {self.answer_s:g} s" if waited_s > self.answer_s else ""
        return f"sends no feedback for {self.silence_s:g} s" if not call.cancelled and 0.0 < self.silence_s < waited_s else ""

    def give_up(self, call: Goal, why: str) -> None:
        """End the execution, as the server is lost; cancel the goal, in case that is received."""
        if not call.cancelled:
            self._cancel(call)
        self._over(call, lambda: self.lose(call, f"{call.server} {why}"))

    def _on_answer(self, goal: Goal, handle: Any) -> None:
        with self._lock:
            goal.handle, goal.since_s = handle, self.watch.now_s
            if handle.accepted:
                handle.get_result_async().add_done_callback(lambda future: self._on_result(goal, future.result()))
                if goal.cancelled:
                    self._cancel(goal)
        if not handle.accepted:
            self._over(goal, lambda: self.lose(goal, f"{goal.server} refuses the goal"))

    def _on_cancel_answered(self, goal: Goal) -> None:
        goal.cancel_answered = True

    def _on_feedback(self, goal: Goal, feedback: Any) -> None:
        if goal.cancelled or not self.is_open(goal):
            return
        goal.since_s = self.watch.now_s
        try:
            goal.progress = min(max(self.part_done(goal.execution, feedback), 0.0), 1.0)
        except Exception as error:  # noqa: BLE001 - this runs on the executor of the node, which lives on
            goal.execution.fail(error_line(error))

    def _on_result(self, goal: Goal, answer: Any) -> None:
        status = answer.status
        if status != GoalStatus.STATUS_SUCCEEDED and not goal.client.server_is_ready():
            self._over(goal, lambda: self.lose(goal, f"{goal.server} is gone"))
        elif status in self.results or goal.stopping:
            self._over(goal, lambda: self.end(goal, lambda: self.ending(goal.execution, status, answer.result)))
        else:
            self._over(goal, lambda: self.lose(goal, f"{goal.server} ended the goal as {STATUS_NAMES.get(status, status)}"))

    def _over(self, goal: Goal, end: Callable[[], None]) -> None:
        """Note the end of a goal: the execution's, but for one that is paused."""
        if goal.paused and not goal.stopping:
            goal.ended = True
        else:
            end()
