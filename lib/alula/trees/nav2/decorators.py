"""Nav2's nodes with one child."""

from __future__ import annotations

import math
from collections.abc import Sequence

from alula.trees.ends import FAILS, SUCCEEDS, Ends, Given
from alula.trees.node import Decorator, Node, NodeConfig
from alula.trees.ports import input_port
from alula.trees.status import FAILURE, IDLE, RUNNING, SUCCESS, Answer
from alula.trees.values import DOUBLE

NANOSECONDS = 1e9


class _Gate(Decorator):
    """Ticks its child when it opens, and from then on until the child has ended; in between it runs."""

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the child."""
        return children[0]

    def update(self) -> Answer:
        """Open or not, and tick."""
        begins = self.status is IDLE
        if begins:
            self.begin()
        opens = begins or self.opens()
        self.become(RUNNING)
        if not opens and self.child.status is not RUNNING:
            return RUNNING
        answer = self.child.execute()
        if answer is SUCCESS:
            self.passed()
        return answer

    def begin(self) -> None:
        """Begin anew; the child is ticked in this tick."""

    def opens(self) -> bool:
        """Return whether the child is ticked again; asked in each tick but the first."""
        raise NotImplementedError

    def passed(self) -> None:
        """Take note that the child has succeeded."""


class RateController(_Gate):
    """Ticks its child so many times a second at most."""

    ports = (input_port("hz", DOUBLE, "10.0", "how often the child is begun", unit="Hz"),)

    remembers = ("_since_ns",)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._since_ns = 0

    def begin(self) -> None:
        """Take the time."""
        self._since_ns = self.now_ns

    def opens(self) -> bool:
        """Return whether a period is over."""
        return (self.now_ns - self._since_ns) / NANOSECONDS * number(self, "hz") >= 1.0

    def passed(self) -> None:
        """Take the time."""
        self._since_ns = self.now_ns


class GoalUpdatedController(_Gate):
    """Ticks its child whenever the goal is another."""

    ports = (
        input_port("goal", doc="the goal (default: the entry 'goal')", optional=True),
        input_port("goals", doc="the goals (default: the entry 'goals')", optional=True),
    )

    remembers = ("_goals",)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._goals: tuple[object, object] = (None, None)

    def begin(self) -> None:
        """Take the goal."""
        self._goals = self._asked()

    def opens(self) -> bool:
        """Return whether there is another goal, once."""
        before, self._goals = self._goals, self._asked()
        return before != self._goals

    def _asked(self) -> tuple[object, object]:
        return read(self, "goal", "goal"), read(self, "goals", "goals")


class SingleTrigger(Decorator):
    """Ticks its child until it has ended once, and fails from then on until it is begun anew."""

    remembers = ("_over",)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the child, or fail."""
        return children[0] | FAILS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._over = False

    def update(self) -> Answer:
        """Tick the child, or fail."""
        if self.status is IDLE:
            self._over = False
        self.become(RUNNING)
        if self._over:
            return FAILURE
        answer = self.child.execute()
        self._over = answer is SUCCESS or answer is FAILURE
        return answer


class _EndsAsChild(Decorator):
    """Ends as its child, whenever it ticks that."""

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the child."""
        return children[0]


class DistanceController(_EndsAsChild):
    """Ticks its child whenever the robot has gone so far."""


class SpeedController(_EndsAsChild):
    """Ticks its child the more often the faster the robot is, and at once when the goal is another."""


class GoalUpdater(_EndsAsChild):
    """Ticks its child with the newest goal that a topic has."""


class PathLongerOnApproach(Decorator):
    """Ticks its child when a new path to the same goal is much longer and the goal is near; else it succeeds."""

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the child, or succeed."""
        return children[0] | SUCCEEDS


def number(node: Node, port: str) -> float:
    """Return the value of an input that is a number."""
    value = node.get(port)
    return value if isinstance(value, float) else math.nan


def read(node: Node, port: str, entry: str = "") -> object:
    """Return the value of an input, that of an entry where the file does not give it; None where there is none."""
    if not node.given(port):
        return node.blackboard.get(entry) if entry else None
    known = node.entry(port)
    return known.value if known is not None else node.config.ports[port]
