"""Hooks that behave as a script says; one class for all middlewares."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from alula.runtime.core.execution import Execution
from alula.runtime.hooks import SkillHooks
from alula_testing.misbehaviours import MISBEHAVIOURS
from alula_testing.traces.script import Behaviour

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
        if self._next.misbehaves and MISBEHAVIOURS[self._next.misbehaves].hook == "validate":
            return MISBEHAVIOURS[self._next.misbehaves].act(inputs)  # type: ignore[no-any-return]  # no text, perhaps
        return self._next.refuse

    def on_dispatch(self, execution: Execution) -> None:
        """Start the function, which may end by itself."""
        now = self._of[execution.id] = self._next
        if now.misbehaves and MISBEHAVIOURS[now.misbehaves].hook == "progress":
            self.ending.add(execution.id)
        self._do("on_dispatch", execution)
        if now.ends:
            self.ending.add(execution.id)
            self._after(now.after_s, lambda: execution.terminate(now.ends, now.message))
        self.dispatched.add(execution.id)

    def progress(self, execution: Execution) -> float:
        """Tell of no progress."""
        misbehaviour = MISBEHAVIOURS.get(self._of[execution.id].misbehaves)
        return misbehaviour.act(execution) if misbehaviour is not None and misbehaviour.hook == "progress" else super().progress(execution)

    def on_pause(self, execution: Execution) -> str | None:
        """Have the function rest, where it can."""
        answer: str | None = self._do("on_pause", execution)
        return answer or ("" if self._of[execution.id].pauses else super().on_pause(execution))

    def on_resume(self, execution: Execution) -> str | None:
        """Have the function go on."""
        answer: str | None = self._do("on_resume", execution)
        return answer or ""

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Stop the function."""
        answer: bool | None = self._do("on_interrupt", execution)
        return answer

    def on_violation(self, execution: Execution) -> None:
        """Stop the function."""
        self._do("on_violation", execution)

    def on_failure(self, execution: Execution) -> None:
        """Stop the function."""
        self._do("on_failure", execution)

    def _do(self, hook: str, execution: Execution) -> Any:
        self.calls.setdefault(execution.id, []).append(hook)
        behaviour = self._of[execution.id]
        if behaviour.raises == hook:
            raise RuntimeError(f"{hook} was told to")
        if behaviour.misbehaves and MISBEHAVIOURS[behaviour.misbehaves].hook == hook:
            return MISBEHAVIOURS[behaviour.misbehaves].act(execution)
        return None
