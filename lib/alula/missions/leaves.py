"""Leaves of a mission's tree that are skills (green in the paper's figures).

A leaf does no work itself and never waits: it starts, looks, and stops.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Generic, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from alula.missions.context import Failure, MissionContext
from alula.missions.skillset import Client
from alula.model.execution_state import ExecutionState
from alula.runtime.handle import SkillHandle

Context = TypeVar("Context", bound=MissionContext)
Inputs = Mapping[str, object] | Callable[[Context], Mapping[str, object]]


def nothing_more(_context: MissionContext) -> None:
    """Do nothing after a success."""


class SkillLeaf(Behaviour, Generic[Context]):  # type: ignore[misc]  # py_trees is seen untyped
    """One skill: started when the leaf is first ticked, watched, interrupted when the tree leaves it.

    RUNNING until the execution has ended; SUCCESS when it TERMINATED with a result in ``success``; else FAILURE, with a
    `Failure` in the context and its sentence as ``feedback_message``. A skill with an empty ``success`` is meant to run
    until it is interrupted, and fails when it ends by itself. ``inputs`` may be a function of the context, called at the
    start. While another execution of the skillset that this tree has interrupted has not ended, the start waits, RUNNING.
    """

    def __init__(
        self,
        name: str,
        client: Client,
        skill: str,
        inputs: Inputs[Context],
        *,
        context: Context,
        success: Collection[str] = (),
        on_success: Callable[[Context], None] = nothing_more,
        halt_waits: bool = False,
    ) -> None:
        super().__init__(name)
        self.client = client
        self.skill = skill
        self.handle: SkillHandle | None = None
        self._interrupted = self._noted = False
        self._inputs = inputs
        self._context = context
        self.success = frozenset(success)
        self._on_success = on_success
        self.halt_waits = halt_waits

    @property
    def skill_name(self) -> str:
        """``skillset.skill``, as in ``navigation.goto``."""
        return f"{self.client.skillset}.{self.skill}"

    def initialise(self) -> None:
        """Forget the last execution; the start itself is in `update`, because it may have to wait."""
        self.handle = None
        self._interrupted = self._noted = False
        self.feedback_message = ""

    def update(self) -> Status:
        """Start the skill when nothing is in its way, then follow its execution."""
        if self.handle is None and not self._start():
            return Status.RUNNING
        handle = self.handle
        if handle is None or not handle.done:
            return Status.RUNNING
        if self._succeeded(handle):
            self.feedback_message = handle.result
            self._on_success(self._context)
            return Status.SUCCESS
        self._note(handle)
        return Status.FAILURE

    def _note(self, handle: SkillHandle) -> None:
        failure = Failure(self.name, self.skill_name, handle.state, handle.result, handle.message)
        self._context.failures.append(failure)
        self._noted = True
        self.feedback_message = failure.sentence()

    def terminate(self, new_status: Status) -> None:
        """Interrupt the execution when the tree leaves the leaf before its end; composites may call this again and again.

        One that has failed since the last tick, together with what the tree leaves the leaf for, is noted with it.
        """
        handle = self.handle
        if new_status is not Status.INVALID or handle is None or self._interrupted:
            return
        if not handle.done:
            self._interrupted = True
            self.feedback_message = "interrupted"
            self._context.pending.interrupt(self.client.skillset, self.skill, handle, holds_all=self.halt_waits)
        elif not self._succeeded(handle) and not self._noted:
            self._note(handle)

    def _succeeded(self, handle: SkillHandle) -> bool:
        return handle.state is ExecutionState.TERMINATED and handle.result in self.success

    @property
    def interrupted(self) -> bool:
        """Return whether the tree has asked for the end of its execution."""
        return self._interrupted

    def recall(self, handle: SkillHandle | None, *, interrupted: bool) -> None:
        """Follow another execution, as it was at another moment of the mission."""
        self.handle, self._interrupted, self._noted = handle, interrupted, False

    def with_inputs(self, inputs: Inputs[Context]) -> None:
        """Start with other inputs from now on."""
        self._inputs = inputs

    def _start(self) -> bool:
        waits_for = self._context.pending.names(self.client.skillset)
        if waits_for:
            self.feedback_message = f"waits for the end of {', '.join(waits_for)}"
            return False
        inputs = self._inputs(self._context) if callable(self._inputs) else self._inputs
        self.feedback_message = ""
        self.handle = self.client.start(self.skill, **inputs)
        return True


def skill_leaf(node: Behaviour) -> SkillLeaf[MissionContext] | None:
    """Return what follows the skill of a leaf, which of a mission that is a file is a part of its node; None for another node."""
    return node if isinstance(node, SkillLeaf) else getattr(node, "leaf", None)
