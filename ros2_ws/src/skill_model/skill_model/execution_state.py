"""The states of an execution (paper, Figure 5)."""

from __future__ import annotations

from enum import Enum


class ExecutionState(Enum):
    """Where an execution is. PAUSED and INTERRUPTING are phases of running: invariants are watched and resources held."""

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

    active: bool
    """Whether the execution has started and not ended."""
    terminal: bool
    """Whether nothing follows."""

    def __init__(self, name: str) -> None:
        # Attributes and no properties: each leaf of a tree asks at each tick.
        self.active = name in {"RUNNING", "PAUSED", "INTERRUPTING"}
        self.terminal = not (self.active or name == "REQUESTED")
