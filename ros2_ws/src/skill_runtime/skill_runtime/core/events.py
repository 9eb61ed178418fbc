"""What an engine tells its listener."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from skill_model.execution_state import ExecutionState


@dataclass(frozen=True)
class ExecutionEvent:
    """An execution entered ``state``; ``result`` is as in ``Execution``."""

    sequence: int
    stamp_ns: int
    skill: str
    id: str
    state: ExecutionState
    result: str
    message: str
    inputs: object
    outputs: Mapping[str, object]


@dataclass(frozen=True)
class TransitionEvent:
    """A resource changed; ``cause`` is ``extern``, ``event <name>`` or ``<skill> <id> <effect>``."""

    sequence: int
    stamp_ns: int
    resource: str
    from_state: str
    to_state: str
    cause: str


EngineEvent = ExecutionEvent | TransitionEvent
Listener = Callable[[Sequence[EngineEvent]], None]
"""Gets the events of one atomic step; calls never overlap and are in the order of the steps."""
