"""What the developer of a skill writes: a class of hooks a skill (paper, Listing 4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import TYPE_CHECKING, ClassVar, TypeVar

from alula.common.public import public

if TYPE_CHECKING:
    from alula.runtime.core.execution import Execution


HookT = TypeVar("HookT", bound=Callable[..., object])


def unwritten(hook: HookT) -> HookT:
    """Mark a hook that does nothing until a subclass overrides it: managers that find it so give it no thread of its own."""
    hook.unwritten = True  # type: ignore[attr-defined]
    return hook


def is_written(hooks: SkillHooks, name: str) -> bool:
    """Return whether a hook does anything: whether it was overridden, or is not marked as ``unwritten``."""
    return not getattr(getattr(hooks, name), "unwritten", False)


@public()
class SkillHooks:
    """Base of all hooks; every method may be overridden, ``on_dispatch`` should be.

    ``on_start`` is called once, when the managers start; no request is taken before it has returned.
    Order of calls for one execution: ``validate``, ``on_dispatch``, any number of ``progress``, ``on_pause`` and ``on_resume``, then
    at most one of ``on_interrupt``, ``on_violation``, ``on_failure``. The last never overtakes ``on_dispatch``, ``on_pause`` or
    ``on_resume``, and none of them is called after ``execution.terminate`` was accepted. ``on_emergency`` may come while any of
    them still waits. Hooks of different executions may run at the same time in different threads.
    A hook that raises, whatever it raises, or takes longer than the managers' ``hook_timeout_s`` to return ends its execution as
    FAILED, and no other. Texts and outputs that it hands over are made fit for every middleware.
    """

    inputs_type: ClassVar[type | None] = None
    """Class made from the inputs by keyword; None makes a ``SimpleNamespace``."""

    def make_inputs(self, values: Mapping[str, object]) -> object:
        """Return the inputs, made of values by name, as ``validate`` receives them and ``execution.inputs`` holds them."""
        return SimpleNamespace(**values) if self.inputs_type is None else self.inputs_type(**values)

    @unwritten
    def on_start(self) -> None:
        """Stop what earlier managers have started, or make sure that nothing runs; may wait a bounded time.

        Called once, when the managers start: they know of no execution then, also where their process was killed while functions ran.
        Where it raises, or does not return in time, the skill refuses all requests and says why.
        """

    @unwritten
    def validate(self, inputs: object) -> str:  # noqa: ARG002
        """Return "" to accept the request, or why it is refused. Called first; changes nothing; may wait a bounded time.

        What is no text ends the execution as FAILED.
        """
        return ""

    @unwritten
    def on_dispatch(self, execution: Execution) -> None:
        """Start the function. Called once, after the start effect was applied; returns soon."""

    def progress(self, execution: Execution) -> float:
        """Return how far the function is, 0 to 1. Called every period of the model while RUNNING."""
        return execution.progress

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Stop the function. Called when an interruption is asked for, before the interrupt effect is applied.

        Return False when the stop is only under way: then call ``execution.interrupted()`` when it is done. When that takes longer
        than the model's ``timeout`` (or the managers' default), ``on_emergency`` is called.
        """

    def on_emergency(self, execution: Execution) -> None:
        """Stop the function by the strongest means there are. Called when a stop was not done in time; the execution ends then."""

    def on_pause(self, execution: Execution) -> str | None:
        """Have the function rest, so that it can go on; return why it can't, or "". Called while RUNNING; what is held stays held."""
        return f"{execution.skill} can't be paused"

    def on_resume(self, execution: Execution) -> str | None:
        """Have the function go on; return why it can't, or "". Called while PAUSED."""
        return f"{execution.skill} can't be resumed"

    def on_violation(self, execution: Execution) -> None:
        """Stop the function. Called after a broken invariant has ended the execution; ``execution.result`` names it."""
        self.on_interrupt(execution)

    def on_failure(self, execution: Execution) -> None:
        """Stop the function. Called after the execution has ended as FAILED, ``execution.message`` says why."""
        self.on_interrupt(execution)


NOT_HOOKS = {"make_inputs"}
HOOKS = tuple(name for name, member in vars(SkillHooks).items() if callable(member) and not name.startswith("_") and name not in NOT_HOOKS)
"""The names of all hooks."""
