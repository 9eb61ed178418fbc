"""Between the values of the port and the messages of a skill's action, in either ROS world."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from alula.model.execution_state import ExecutionState
from alula.model.ros_types import FEEDBACK_FIELDS, RESULT_FIELDS
from alula.runtime.core.events import ExecutionEvent
from alula.runtime.field_types import FieldTypes
from alula.runtime.middleware import GoalResult


class ActionMessages:
    """Makes and reads goals, feedback and results.

    Args:
        skill: its name, for errors.
        types: how this ROS world tells the fields of messages.
        goal: the class of goals; ``feedback`` and ``result`` alike.
        on_error: gets what is wrong with outputs that do not fit their message.
    """

    def __init__(
        self,
        skill: str,
        types: FieldTypes,
        *,
        goal: Callable[[], Any],
        feedback: Callable[..., Any],
        result: Callable[..., Any],
        on_error: Callable[[str], object],
    ) -> None:
        self._skill = skill
        self._types = types
        self._goal = goal
        self._feedback = feedback
        self._result = result
        self._on_error = on_error

    # --- for the managers ------------------------------------------------------------------------------------------------

    def inputs_of(self, plain: Mapping[str, object]) -> dict[str, object]:
        """Return inputs as a goal carries them, from plain values; raise ValueError where they don't fit."""
        return self.read_goal(self.fit(plain, f"inputs of {self._skill}"))

    def read_goal(self, goal: Any) -> dict[str, object]:
        """Return the inputs of a goal."""
        return self._types.values_of(goal)

    def make_feedback(self, progress: float, state: ExecutionState, outputs: Mapping[str, object]) -> Any:
        """Return a feedback; without outputs where they don't fit."""
        feedback = self._feedback(progress=progress, state=state.value)
        self._fill_outputs(feedback, outputs)
        return feedback

    def make_result(self, event: ExecutionEvent) -> Any:
        """Return the result of an execution that has ended; its message says what is wrong with outputs that don't fit."""
        result = self._result(outcome=event.state.value, result=event.result, message=event.message)
        wrong = self._fill_outputs(result, event.outputs)
        if wrong:
            result.message = f"{result.message} ({wrong})".strip()
        return result

    def _fill_outputs(self, message: Any, outputs: Mapping[str, object]) -> str:
        """Set the outputs of a message; return what is wrong with them, or ""."""
        try:
            self._types.fill(message, outputs, self._outputs_place)
        except ValueError as error:
            self._on_error(str(error))
            return str(error)
        return ""

    # --- for a client ----------------------------------------------------------------------------------------------------

    def fit(self, inputs: Mapping[str, object], place: str) -> Any:
        """Return a goal to be sent; raise ValueError, which names ``place``, where the inputs don't fit."""
        return self._types.fill(self._goal(), inputs, place)

    def outputs_of(self, plain: Mapping[str, object]) -> dict[str, Any]:
        """Return outputs as a result carries them, from plain values: those that are missing as an empty message has them."""
        return self._outputs(self._types.fill(self._result(), plain, self._outputs_place), RESULT_FIELDS)

    def read_feedback(self, message: Any) -> tuple[float, dict[str, Any]]:
        """Return progress (0 to 1) and outputs by name of a feedback message."""
        return message.progress, self._outputs(message, FEEDBACK_FIELDS)

    def read_result(self, message: Any) -> GoalResult:
        """Return how an execution ended."""
        outputs = self._outputs(message, RESULT_FIELDS)
        return GoalResult(ExecutionState(message.outcome), message.result, message.message, outputs)

    def _outputs(self, message: Any, others: tuple[str, ...]) -> dict[str, Any]:
        return {name: value for name, value in self._types.values_of(message).items() if name not in others}

    @property
    def _outputs_place(self) -> str:
        return f"outputs of {self._skill}"
