"""The states of an execution (paper, Figure 5)."""

from __future__ import annotations

from enum import Enum

from alula.common.public import public


@public()
class ExecutionState(Enum):
    """The state of an execution. PAUSED and INTERRUPTING are phases of running: invariants are watched and resources held."""

    REQUESTED = "REQUESTED"
    RUNNING = "RUNNING"
    PAUSED = "PAUSED"
    INTERRUPTING = "INTERRUPTING"
    NOT_VALIDATED = "NOT_VALIDATED"
    NOT_READY = "NOT_READY"
    RESOURCE_INVARIANT_VIOLATED = "RESOURCE_INVARIANT_VIOLATED"
    INTERRUPTED = "INTERRUPTED"
    TERMINATED = "TERMINATED"
    FAILED = "FAILED"

    @property
    def terminal(self) -> bool:
        """Return whether it is an end: no state follows it."""
        return self._value_ not in _OPEN

    @property
    def active(self) -> bool:
        """Return whether the execution has started and not ended."""
        return self._value_ in _ACTIVE


# By value, whose hash is at hand: each leaf of a tree asks at each tick.
_ACTIVE = frozenset({"RUNNING", "PAUSED", "INTERRUPTING"})
_OPEN = _ACTIVE | {"REQUESTED"}
