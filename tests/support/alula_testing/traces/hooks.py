"""Hooks that behave as a script says; one class for all middlewares."""

from __future__ import annotations

from collections.abc import Callable

from alula_testing.traces.script import Behaviour
from skill_runtime.core.execution import Execution
from skill_runtime.hooks import SkillHooks

After = Callable[[float, Callable[[], object]], object]


class ScriptedHooks(SkillHooks):
    """The hooks of one skill; ``after`` runs a job after so many seconds of mission clock."""

    def __init__(self, inputs_type: type, behaviours: tuple[Behaviour, ...], after: After) -> None:
        self.inputs_type = inputs_type  # type: ignore[misc]  # a class variable where hooks are written by hand
        self.validated = 0
        self.calls: dict[str, list[str]] = {}
        self.dispatched: set[str] = set()
        self.ending: set[str] = set()
        self._behaviours = behaviours
        self._after = after
        self._next = Behaviour()
        self._of: dict[str, Behaviour] = {}

    def validate(self, inputs: object) -> str:
        """Begin the next call of the skill."""
        calls = self._behaviours
        self._next = calls[self.validated] if self.validated < len(calls) else Behaviour()
        self.validated += 1
        if self._next.raises == "validate":
            raise RuntimeError("validate was told to")
        return self._next.refuse

    def on_dispatch(self, execution: Execution) -> None:
        """Start the function, which may end by itself."""
        now = self._of[execution.id] = self._next
        self._do("on_dispatch", execution)
        if now.ends:
            self.ending.add(execution.id)
            self._after(now.after_s, lambda: execution.terminate(now.ends, now.message))
        self.dispatched.add(execution.id)

    def on_pause(self, execution: Execution) -> str | None:
        """Have the function rest, where it can."""
        self._do("on_pause", execution)
        return "" if self._of[execution.id].pauses else super().on_pause(execution)

    def on_resume(self, execution: Execution) -> str | None:
        """Have the function go on."""
        self._do("on_resume", execution)
        return ""

    def on_interrupt(self, execution: Execution) -> None:
        """Stop the function."""
        self._do("on_interrupt", execution)

    def on_violation(self, execution: Execution) -> None:
        """Stop the function."""
        self._do("on_violation", execution)

    def on_failure(self, execution: Execution) -> None:
        """Stop the function."""
        self._do("on_failure", execution)

    def _do(self, hook: str, execution: Execution) -> None:
        self.calls.setdefault(execution.id, []).append(hook)
        if self._of[execution.id].raises == hook:
            raise RuntimeError(f"{hook} was told to")
