"""Follows one goal from its sending to its end; used by the client's thread only."""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Callable
from typing import Any

from skill_model.execution_state import ExecutionState
from skill_runtime.handle import SkillHandle
from skill_runtime.waiting import Host, Pending
from skillset_ros1.convert import fields_of, fill
from skillset_ros1.link import SkillLink

ACKNOWLEDGE_TIMEOUT_S = 5.0
"""Managers acknowledge any goal at once; no sign for so long (wall clock) means that there will be none."""
GRACE_S = 0.5
"""An end waits so long for what belongs to it and comes over another connection: the resources after the step, the event."""
ID_DIGITS = 12

Do = Callable[[Callable[[], None]], None]
Pause = Callable[[str, bool], Pending[str]]
"""Pauses or resumes an execution; the answer is "", or why not."""

_FEEDBACK_FIELDS = ("progress", "state")
_RESULT_FIELDS = ("outcome", "result", "message")


class Pursuit:
    """One goal; ``handle`` is what the caller gets, ``do`` runs a job on the client's thread."""

    def __init__(
        self, skillset: str, skill: str, link: SkillLink, do: Callable[[Callable[[], None]], None], pause: Pause, host: Host
    ) -> None:
        identifier = uuid.uuid4().hex[:ID_DIGITS]
        self.handle = SkillHandle(skill, identifier, lambda: do(self._interrupt), pause=lambda paused: pause(identifier, paused), host=host)
        self._skillset = skillset
        self._link = link
        self._sent_s = time.monotonic()
        self._life = ""
        self._interrupt_wanted = False
        self._end: tuple[float, int, Any] | None = None

    def send(self, goal: Any) -> None:
        """Send the goal."""
        self._sent_s = time.monotonic()
        self._link.send(self.handle.id, goal)

    @property
    def restless(self) -> bool:
        """Tell whether ``settle`` has to be called even when nothing comes."""
        return not self._life or self._end is not None

    def on_event(self, event: Any, life: str, after: int) -> None:
        """Take an event of this execution; its end is told when the resources are known as they were after event ``after``."""
        self._acknowledge(life)
        state = ExecutionState(event.state)
        if state.terminal:
            self._end = (time.monotonic(), after, result_of(self._link.types.result, self.handle.skill, event))
        elif state.active:
            self.handle.enter(state)

    def on_feedback(self, feedback: Any, life: str) -> None:
        """Take a feedback of this execution."""
        self._acknowledge(life)
        self.handle.run(feedback.progress, {name: getattr(feedback, name) for name in fields_of(feedback) if name not in _FEEDBACK_FIELDS})

    def on_result(self, result: Any, life: str) -> None:
        """Take the result; the event of the same end, which says when it was, is waited for a little."""
        self._acknowledge(life)
        if self._end is None:
            never = 2**63
            self._end = (time.monotonic(), never, result)

    def settle(self, known: int) -> None:
        """End what can be ended: the resources are known as they were after event ``known``."""
        now = time.monotonic()
        if self._end is not None and (known >= self._end[1] or now - self._end[0] > GRACE_S):
            self._finish(self._end[2])
        elif not self._life and now - self._sent_s > ACKNOWLEDGE_TIMEOUT_S:
            self.handle.fail(f"the managers of {self._skillset} did not answer within {ACKNOWLEDGE_TIMEOUT_S:g} s")

    def outlived(self, life: str) -> None:
        """End because other managers have taken the place of those that had acknowledged it."""
        if self._life and self._life != life:
            self.abandon(f"the managers of {self._skillset} were started anew and do not know this execution")

    def abandon(self, reason: str) -> None:
        """End because the managers have gone: as they last said, or else as FAILED for this reason."""
        if self._end is not None:
            self._finish(self._end[2])
        self.handle.fail(reason)

    def _acknowledge(self, life: str) -> None:
        first, self._life = not self._life, life
        if first and self._interrupt_wanted:
            self._link.cancel(self.handle.id)

    def _interrupt(self) -> None:
        self._interrupt_wanted = True
        # Before that the cancellation, which goes over another connection, might overtake the goal.
        if self._life:
            self._link.cancel(self.handle.id)

    def _finish(self, result: Any) -> None:
        self.handle.end(ExecutionState(result.outcome), result.result, result.message, outputs_of(result))


def result_of(kind: Any, skill: str, said: Any) -> Any:
    """Return the action's result that belongs to an end as ``Event`` and ``SkillExecution`` tell it."""
    result = kind(outcome=said.state, result=said.result, message=said.message)
    outputs = {name: value for name, value in json.loads(said.outputs_json or "{}").items() if value is not None}
    return fill(result, outputs, f"outputs of {skill}")


def outputs_of(result: Any) -> dict[str, Any]:
    """Return the outputs in an action's result."""
    return {name: getattr(result, name) for name in fields_of(result) if name not in _RESULT_FIELDS}
