"""One execution as its client sees it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from skill_runtime.core.execution import ExecutionState


def _nothing() -> None:
    """Interrupt nobody."""


class SkillHandle:
    """An execution that was asked for; all of it may be read from any thread, nothing of it waits but ``wait``.

    ``result`` names the model's result when TERMINATED, the precondition when NOT_READY, the invariant when
    RESOURCE_INVARIANT_VIOLATED. ``outcome`` is the terminal state's name, empty before.
    """

    def __init__(self, skill: str, execution_id: str, interrupt: Callable[[], None] = _nothing) -> None:
        self.skill = skill
        self.id = execution_id
        self.state = ExecutionState.REQUESTED
        self.outcome = ""
        self.result = ""
        self.message = ""
        self.outputs: dict[str, object] = {}
        self.progress = 0.0
        self._interrupt = interrupt
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._callbacks: list[Callable[[SkillHandle], None]] = []

    @property
    def done(self) -> bool:
        """Tell whether the execution has ended and its outcome is known."""
        return self.state.terminal

    def interrupt(self) -> None:
        """Ask for the end; returns at once, without effect when it has ended already."""
        if not self.done:
            self._interrupt()

    def add_done_callback(self, callback: Callable[[SkillHandle], None]) -> None:
        """Have ``callback(handle)`` called once at the end, on the thread that spins the node; at once when it has ended."""
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

    def run(self, progress: float = 0.0, outputs: Mapping[str, object] | None = None) -> None:
        """Be RUNNING, unless it has ended."""
        with self._lock:
            if self.done:
                return
            self.state = ExecutionState.RUNNING
            self.progress = max(self.progress, progress) if outputs is None else progress
            self.outputs = dict(outputs or self.outputs)

    def end(self, state: ExecutionState, result: str, message: str, outputs: Mapping[str, object] | None = None) -> None:
        """Enter a terminal state, unless it has one."""
        with self._lock:
            if self.done:
                return
            self.result, self.message = result, message
            self.outputs = dict(outputs or self.outputs)
            self.outcome = state.value
            self.state = state
            callbacks, self._callbacks = self._callbacks, []
        self._ended.set()
        for callback in callbacks:
            callback(self)

    def fail(self, message: str) -> None:
        """End as FAILED for a reason on the client's side."""
        self.end(ExecutionState.FAILED, "", message)
