"""How the engine calls hooks: in this process (``LocalHooks``), or wherever else they are."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from alula.model.model import Skillset
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.execution import Execution
from alula.runtime.core.sanitize import as_text, error_line, fitted_return
from alula.runtime.hooks import SkillHooks, is_written


@dataclass(frozen=True)
class HookOutcome:
    """The outcome of a hook's call: its ``value``; or ``wrong``, why its value is refused; or what it raised: ``error``, ``trace``."""

    value: object = None
    error: str = ""
    trace: str = ""
    wrong: str = ""


Then = Callable[[HookOutcome], None]


class HookCaller(Protocol):
    """Calls hooks for the engine."""

    def call(self, execution: Execution, hook: str, then: Then) -> None:
        """Call a hook of the execution's skill; ``then`` gets the answer, once, in this call or later, from any thread.

        Never raises. A hook that can't be reached any more is answered with an error.
        """
        ...

    def written(self, skill: str, hook: str) -> bool:
        """Return whether the hook does anything (see ``hooks.is_written``): then it may wait; else it need not be called."""
        ...


class LocalHooks:
    """Hooks in this process, called in the thread that asks; ``then`` is called before ``call`` returns."""

    def __init__(self, skillset: Skillset, hooks: Mapping[str, SkillHooks]) -> None:
        _check(skillset, hooks)
        self._hooks = dict(hooks)

    def call(self, execution: Execution, hook: str, then: Then) -> None:
        """Call a hook; ``validate`` gets the inputs, ``on_start`` nothing, every other the execution."""
        then(call_hook(self._hooks[execution.skill], execution, hook))

    def written(self, skill: str, hook: str) -> bool:
        """Return whether the hook is written."""
        return is_written(self._hooks[skill], hook)


def call_hook(hooks: SkillHooks, execution: Execution, hook: str) -> HookOutcome:
    """Call one hook and return the outcome."""
    try:
        value = getattr(hooks, hook)(*_arguments(execution, hook))
    except BaseException as error:  # noqa: BLE001 - whatever a hook raises, also SystemExit, ends its execution only
        return HookOutcome(error=error_line(error), trace=as_text(_trace(error)))
    try:
        return HookOutcome(fitted_return(hook, value))
    except ValueError as error:
        return HookOutcome(wrong=str(error))


def _arguments(execution: Execution, hook: str) -> tuple[object, ...]:
    match hook:
        case "on_start":
            return ()
        case "validate":
            return (execution.inputs,)
        case _:
            return (execution,)


def _trace(error: BaseException) -> str:
    try:
        return "".join(traceback.format_exception(error))
    except BaseException:  # noqa: BLE001 - an exception that can't be printed
        return error_line(error)


def _check(skillset: Skillset, hooks: Mapping[str, SkillHooks]) -> None:
    skills = [skill.name for skill in skillset.skills]
    missing = [name for name in skills if name not in hooks]
    surplus = [name for name in hooks if name not in skills]
    if missing:
        raise SkillRuntimeError(f"skillset {skillset.name}: no hooks for {', '.join(missing)}; the hooks factory must return one a skill")
    if surplus:
        raise SkillRuntimeError(f"skillset {skillset.name} has no skill {', '.join(surplus)}; it has {', '.join(skills)}")
