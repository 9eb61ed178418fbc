"""What a tick answers.

What a node is between ticks are py_trees' four values, IDLE by its name INVALID. That it was skipped is an answer and no state: a skipped
node stays idle, so SKIPPED, which py_trees has not, is a value of its own.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, TypeAlias

from py_trees import common

if TYPE_CHECKING:

    class Status(Enum):
        """How a node ended its last tick, by py_trees' names; INVALID: it is idle."""

        SUCCESS = "SUCCESS"
        FAILURE = "FAILURE"
        RUNNING = "RUNNING"
        INVALID = "INVALID"
else:
    Status = common.Status


class Skipped(Enum):
    """The answer of a node that its condition has skipped."""

    SKIPPED = "SKIPPED"


Answer: TypeAlias = Status | Skipped
IDLE = Status.INVALID
RUNNING = Status.RUNNING
SUCCESS = Status.SUCCESS
FAILURE = Status.FAILURE
SKIPPED = Skipped.SKIPPED
NAMES: dict[Answer, str] = {IDLE: "IDLE", RUNNING: "RUNNING", SUCCESS: "SUCCESS", FAILURE: "FAILURE", SKIPPED: "SKIPPED"}
"""As BehaviorTree.CPP writes them."""
ANSWERS: dict[str, Answer] = {name: answer for answer, name in NAMES.items()}
