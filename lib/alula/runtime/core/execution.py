"""One execution of a skill (paper, Figure 5)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from alula.common.public import public
from alula.model.execution_state import ExecutionState
from alula.model.unmet import Unmet


class Controller(Protocol):
    """What an execution needs of the engine that runs it."""

    def terminate(self, execution_id: str, result: str, message: str, outputs: Mapping[str, object]) -> bool:
        """End a running execution with a result of the model."""
        ...

    def fail(self, execution_id: str, message: str) -> bool:
        """End an execution as FAILED."""
        ...

    def interrupted(self, execution_id: str, message: str) -> bool:
        """End an execution that is being interrupted."""
        ...

    def set_outputs(self, execution_id: str, outputs: Mapping[str, object]) -> None:
        """Keep outputs of a running execution."""
        ...


@public()
class Execution:
    """One execution of a skill, as its hooks see it; only the engine writes its attributes, any thread reads them.

    ``result`` is the result's name in the model when TERMINATED, the precondition's when NOT_READY, the invariant's when
    RESOURCE_INVARIANT_VIOLATED, else empty. ``unmet`` is what was not as the skill needs it when it was refused as NOT_READY or ended by
    an invariant.
    """

    def __init__(self, controller: Controller, execution_id: str, skill: str, inputs: object) -> None:
        self._controller = controller
        self.id = execution_id
        self.skill = skill
        self.inputs: Any = inputs  # of the class that the skill's hooks make
        self.state = ExecutionState.REQUESTED
        self.result = ""
        self.message = ""
        self.unmet: tuple[Unmet, ...] = ()
        self.outputs: dict[str, object] = {}
        self.progress = 0.0

    @property
    def done(self) -> bool:
        """Return whether the execution has ended."""
        return self.state.terminal

    def terminate(self, result: str, message: str = "", outputs: Mapping[str, object] | None = None) -> bool:
        """End with a result of the model, from any thread. False when the execution has ended already, which is no error."""
        return self._controller.terminate(self.id, result, message, outputs or {})

    def fail(self, message: str) -> bool:
        """End as FAILED: the function can't be started or watched any more. False when it has ended already."""
        return self._controller.fail(self.id, message)

    def interrupted(self, message: str = "") -> bool:
        """Report that the stop begun by ``on_interrupt`` is complete. False when no stop is under way (any more)."""
        return self._controller.interrupted(self.id, message)

    def set_outputs(self, **outputs: object) -> None:
        """Keep outputs to be reported with the next progress; ignored after the end."""
        self._controller.set_outputs(self.id, outputs)

    def __repr__(self) -> str:
        return f"Execution({self.skill} {self.id} {self.state.value})"
