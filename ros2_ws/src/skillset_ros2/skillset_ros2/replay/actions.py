"""Actions of the functional layer in a replay: goals that were sent to an actionlib server then are answered as it answered them."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from types import SimpleNamespace
from typing import Any

from action_msgs.msg import GoalStatus

from alula.common.plain import to_plain
from alula.records.replay.comparison import alike
from skillset_ros2.replay.node import RecordedFuture, Subscribers

STATUS = {2: GoalStatus.STATUS_CANCELED, 3: GoalStatus.STATUS_SUCCEEDED, 4: GoalStatus.STATUS_ABORTED, 8: GoalStatus.STATUS_CANCELED}
"""Of actionlib's ends of a goal that was accepted."""
REFUSED = 5


def values_of_goal(value: object) -> object:
    """Return a goal's plain values without its headers, whose stamps are of then, and without what only the bag's reader knows."""
    if not isinstance(value, Mapping):
        return value
    return {name: values_of_goal(part) for name, part in value.items() if name not in {"header", "__msgtype__"}}


class RecordedGoal:
    """A recorded goal, with the methods of rclpy's handle."""

    def __init__(self, feedback: Callable[[Any], None] | None) -> None:
        self.accepted = True
        self.answered = RecordedFuture()
        self._feedback = feedback
        self._ended = RecordedFuture()

    def get_result_async(self) -> RecordedFuture:
        """Return a future of the recorded end."""
        return self._ended

    def cancel_goal_async(self) -> RecordedFuture:
        """Do nothing: the record has the goal's end."""
        return RecordedFuture()

    def answer(self, *, accepted: bool = True) -> None:
        """Return whether the server took it, at the first that is heard of it."""
        if self.answered.result() is None:
            self.accepted = accepted
            self.answered.resolve(self)

    def hear(self, feedback: object) -> None:
        """Report the goal's feedback."""
        self.answer()
        if self._feedback is not None:
            self._feedback(SimpleNamespace(feedback=feedback))

    def end(self, status: int, result: object) -> None:
        """Report the goal's end."""
        self.answer(accepted=status != REFUSED)
        if status in STATUS:
            self._ended.resolve(SimpleNamespace(status=STATUS[status], result=result))


class RecordedActionClient:
    """A client of an action whose goals, feedback and ends are in the bag of the functional layer.

    Args:
        name: of the server.
        goals: the goals that the bag tells of, in their order.
        subscribers: the callbacks by topic, to which this client's are added.
        differs: what is told of a goal that was not sent then.
    """

    def __init__(self, name: str, goals: Iterable[Any], subscribers: Subscribers, differs: Callable[[str], None]) -> None:
        self._name = name
        self._waiting = deque(goals)
        self._differs = differs
        self._sent: dict[str, RecordedGoal] = {}
        subscribers.setdefault(f"{name}/feedback", []).append(self._on_feedback)
        subscribers.setdefault(f"{name}/result", []).append(self._on_result)

    def server_is_ready(self) -> bool:
        """Return True: the record answers."""
        return True

    def send_goal_async(self, goal: object, feedback_callback: Callable[[Any], None] | None = None) -> RecordedFuture:
        """Return a future of the recorded answer to this goal; one that was not sent then is a difference, and has no answer."""
        sent, now = RecordedGoal(feedback_callback), values_of_goal(to_plain(goal))
        then = values_of_goal(to_plain(self._waiting[0].goal)) if self._waiting else None
        if then is not None and alike(then, now):
            self._sent[str(self._waiting.popleft().goal_id.id)] = sent
        else:
            self._differs(f"goal of {self._name}: then {'none' if then is None else json.dumps(then)}, now {json.dumps(now)}")
        return sent.answered

    def _on_feedback(self, message: Any) -> None:
        sent = self._sent.get(str(message.status.goal_id.id))
        if sent is not None:
            sent.hear(message.feedback)

    def _on_result(self, message: Any) -> None:
        sent = self._sent.pop(str(message.status.goal_id.id), None)
        if sent is not None:
            sent.end(int(message.status.status), message.result)
