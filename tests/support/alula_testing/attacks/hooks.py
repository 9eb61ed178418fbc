"""Functions that run until they are ended, and functions that misbehave at random."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Mapping
from typing import Any

from alula.runtime.core import Execution
from alula.runtime.hooks import SkillHooks
from alula_testing.misbehaviours import MISBEHAVIOURS, Misbehaviour

TAME = Misbehaviour("", lambda _: None)
After = Callable[[float, Callable[[], object]], object]
"""Has a job done after seconds."""


class TameHooks(SkillHooks):
    """Does nothing, as long as it is asked to."""

    def on_pause(self, execution: Execution) -> str:
        """Rest."""
        return ""

    def on_resume(self, execution: Execution) -> str:
        """Go on."""
        return ""


class RandomHooks(SkillHooks):
    """Each execution misbehaves in a way of its own, in one hook; every other one ends by itself."""

    def __init__(self, after: After, misbehaviours: Mapping[str, Misbehaviour], chance: random.Random) -> None:
        self._after = after
        self._misbehaviours = list(misbehaviours.values())
        self._chance = chance
        self._next = TAME
        self._of: dict[str, Misbehaviour] = {}

    def validate(self, inputs: object) -> str:
        """Choose the misbehaviour."""
        self._next = chosen = self._chance.choice([TAME, self._chance.choice(self._misbehaviours)])
        answer: str = chosen.act(inputs) if chosen.hook == "validate" else ""
        return answer

    def on_dispatch(self, execution: Execution) -> None:
        """Start."""
        self._of[execution.id] = self._next
        if self._chance.random() < 0.5:
            self._after(self._chance.uniform(0.0, 2.0), lambda: execution.terminate("DONE"))
        self._do("on_dispatch", execution)

    def progress(self, execution: Execution) -> float:
        """Tell of some progress."""
        answer: float = self._do("progress", execution, self._chance.random())
        return answer

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Stop, at once or not; never, perhaps."""
        answer: bool | None = self._do("on_interrupt", execution, self._chance.choice([None, False]))
        return answer

    def on_pause(self, execution: Execution) -> str | None:
        """Rest."""
        answer: str | None = self._do("on_pause", execution, "")
        return answer

    def on_resume(self, execution: Execution) -> str | None:
        """Go on."""
        answer: str | None = self._do("on_resume", execution, "")
        return answer

    def on_violation(self, execution: Execution) -> None:
        """Stop."""
        self._do("on_violation", execution)

    def on_failure(self, execution: Execution) -> None:
        """Stop."""
        self._do("on_failure", execution)

    def _do(self, hook: str, execution: Execution, otherwise: object = None) -> Any:
        misbehaviour = self._of.get(execution.id, TAME)
        return misbehaviour.act(execution) if misbehaviour.hook == hook else otherwise


def hanging(seconds: float) -> dict[str, Misbehaviour]:
    """Return misbehaviours that do not return for so long (wall clock), one a hook."""
    hooks = ("validate", "on_dispatch", "progress", "on_interrupt", "on_pause", "on_resume", "on_violation", "on_failure")
    return {f"{hook} hangs": Misbehaviour(hook, lambda _: time.sleep(seconds)) for hook in hooks}


def tame_hooks(abstract_hooks: Mapping[str, Any]) -> dict[str, SkillHooks]:
    """Return hooks for each skill, with its own inputs."""
    return {name: type("Tame", (TameHooks,), {"inputs_type": hooks.inputs_type})() for name, hooks in abstract_hooks.items()}


def random_hooks(
    abstract_hooks: Mapping[str, Any], after: After, chance: random.Random, more: Mapping[str, Misbehaviour] | None = None
) -> dict[str, SkillHooks]:
    """Return hooks for each skill that misbehave at random, in the ways of the table and in some more."""
    known = {**MISBEHAVIOURS, **(more or {})}
    return {
        name: type("Random", (RandomHooks,), {"inputs_type": hooks.inputs_type})(after, known, chance)
        for name, hooks in abstract_hooks.items()
    }
