"""One execution as its client sees it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from skill_runtime.core.execution import ExecutionState
from skill_runtime.ros2.convert import fields_of

_RESULT_FIELDS = ("outcome", "result", "message")


class SkillHandle:
    """An execution that was asked for; all of it may be read from any thread, nothing of it waits but ``wait``.

    ``result`` names the model's result when TERMINATED, the precondition when NOT_READY, the invariant when
    RESOURCE_INVARIANT_VIOLATED. ``outcome`` is the terminal state's name, empty before.
    """

    def __init__(self, skill: str, execution_id: str) -> None:
        self.skill = skill
        self.id = execution_id
        self.state = ExecutionState.REQUESTED
        self.outcome = ""
        self.result = ""
        self.message = ""
        self.outputs: dict[str, object] = {}
        self.progress = 0.0
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._callbacks: list[Callable[[SkillHandle], None]] = []
        self._goal: Any = None
        self._interrupt_wanted = False

    @property
    def done(self) -> bool:
        """Tell whether the execution has ended and its outcome is known."""
        return self.state.terminal

    def interrupt(self) -> None:
        """Ask for the end; without effect when it has ended already."""
        with self._lock:
            self._interrupt_wanted = True
            goal = None if self.done else self._goal
        if goal is not None:
            goal.cancel_goal_async()

    def add_done_callback(self, callback: Callable[[SkillHandle], None]) -> None:
        """Have ``callback(handle)`` called once at the end, by the executor's thread; at once when it has ended already."""
        with self._lock:
            if not self.done:
                self._callbacks.append(callback)
                return
        callback(self)

    def wait(self, timeout_s: float) -> bool:
        """Wait (wall clock) for the end while another thread spins the node; tell whether it came."""
        return self._ended.wait(timeout_s)

    def __repr__(self) -> str:
        return f"SkillHandle({self.skill} {self.id} {self.state.value} {self.result})"

    # --- for the client ----------------------------------------------------------------------------------------------

    @property
    def accepted(self) -> bool:
        """Tell whether the managers have taken the goal."""
        return self._goal is not None

    def _accept(self, goal: Any) -> None:
        with self._lock:
            self._goal = goal
            wanted = self._interrupt_wanted
        if wanted:
            goal.cancel_goal_async()

    def _on_feedback(self, message: Any) -> None:
        feedback = message.feedback
        with self._lock:
            if self.done:
                return
            self.state = ExecutionState.RUNNING
            self.progress = feedback.progress
            self.outputs = {name: getattr(feedback, name) for name in fields_of(feedback) if name != "progress"}

    def _on_result(self, result: Any) -> None:
        outputs = {name: getattr(result, name) for name in fields_of(result) if name not in _RESULT_FIELDS}
        if result.outcome:
            self._end(ExecutionState(result.outcome), result.result, result.message, outputs)
        else:
            self._end(ExecutionState.FAILED, "", "the managers do not know this execution; they were started anew", {})

    def _end(self, state: ExecutionState, result: str, message: str, outputs: dict[str, object]) -> None:
        """Enter a terminal state, unless it has one."""
        with self._lock:
            if self.done:
                return
            self.result, self.message = result, message
            self.outputs = outputs or self.outputs
            self.outcome = state.value
            self.state = state
            callbacks, self._callbacks = self._callbacks, []
        self._ended.set()
        for callback in callbacks:
            callback(self)

    def fail(self, message: str) -> None:
        """End as FAILED for a reason on the client's side."""
        self._end(ExecutionState.FAILED, "", message, {})
