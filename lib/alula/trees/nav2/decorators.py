"""Nav2's nodes with one child."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import ClassVar, TypeAlias

from alula.trees.ends import FAILS, SUCCEEDS, Ends, Given
from alula.trees.errors import TickError
from alula.trees.node import Decorator, Node, Wiring
from alula.trees.palette import Port, input_port, output_port
from alula.trees.status import FAILURE, IDLE, RUNNING, SUCCESS, Answer
from alula.trees.values import DOUBLE, STRING

NANOSECONDS = 1e9
Point: TypeAlias = Sequence[float]
"""Metres, in the frame of the map."""


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
        """Tell whether the child is ticked again; asked in each tick but the first."""
        raise NotImplementedError

    def passed(self) -> None:
        """Take note that the child has succeeded."""


class RateController(_Gate):
    """Ticks its child so many times a second at most."""

    ports = (input_port("hz", DOUBLE, "10.0", "how often the child is begun", unit="Hz"),)

    remembers = ("_since_ns",)

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._since_ns = 0

    def begin(self) -> None:
        """Take the time."""
        self._since_ns = self.now_ns

    def opens(self) -> bool:
        """Tell whether a period is over."""
        return (self.now_ns - self._since_ns) / NANOSECONDS * number(self, "hz") >= 1.0

    def passed(self) -> None:
        """Take the time."""
        self._since_ns = self.now_ns


class DistanceController(_Gate):
    """Ticks its child whenever the robot has gone so far."""

    ports = (
        input_port("distance", DOUBLE, "1.0", "how far the robot goes before the child is begun again", unit="m"),
        input_port("global_frame", STRING, None, "reference frame", optional=True),
        input_port("robot_base_frame", STRING, None, "the robot's own frame", optional=True),
    )

    remembers = ("_from",)

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._from: Point = ()

    def where(self) -> Point:
        """Return where the robot is."""
        return (0.0, 0.0, 0.0)

    def begin(self) -> None:
        """Take the place."""
        self._from = self.where()

    def opens(self) -> bool:
        """Tell whether the robot has gone far enough."""
        return math.dist(self._from, self.where()) >= number(self, "distance")

    def passed(self) -> None:
        """Take the place."""
        self._from = self.where()


class _GoalGate(_Gate):
    """Opens when the goal is another."""

    ports: ClassVar[tuple[Port, ...]] = (
        input_port("goal", doc="the goal (default: the entry 'goal')", optional=True),
        input_port("goals", doc="the goals (default: the entry 'goals')", optional=True),
    )

    remembers: ClassVar[tuple[str, ...]] = ("_goals",)

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._goals: tuple[object, object] = (None, None)

    def begin(self) -> None:
        """Take the goal."""
        self._goals = self._asked()

    def opens(self) -> bool:
        """Tell whether there is another goal, once."""
        before, self._goals = self._goals, self._asked()
        return before != self._goals

    def _asked(self) -> tuple[object, object]:
        return read(self, "goal", "goal"), read(self, "goals", "goals")


class GoalUpdatedController(_GoalGate):
    """Ticks its child whenever the goal is another."""


class SpeedController(_GoalGate):
    """Ticks its child the more often the faster the robot is, and at once when the goal is another."""

    ports = (
        input_port("min_rate", DOUBLE, "0.1", "how often the child is begun at the lowest speed", unit="Hz"),
        input_port("max_rate", DOUBLE, "1.0", "how often the child is begun at the highest speed", unit="Hz"),
        input_port("min_speed", DOUBLE, "0.0", "lowest speed", unit="m/s"),
        input_port("max_speed", DOUBLE, "0.5", "highest speed", unit="m/s"),
        *_GoalGate.ports,
    )

    remembers = ("_goals", "_since_ns", "_period_s")

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._since_ns = 0
        self._period_s = 0.0

    def speed(self) -> float:
        """Return the robot's speed, m/s."""
        return 0.0

    def begin(self) -> None:
        """Take the goal and the time; the first period is that of the highest speed."""
        super().begin()
        least, most = number(self, "min_rate"), number(self, "max_rate")
        if least <= 0.0 or most <= 0.0:
            raise TickError(f"{self.place()}: a SpeedController can't have a rate of 0 or less")
        self._since_ns, self._period_s = self.now_ns, 1.0 / most

    def opens(self) -> bool:
        """Tell whether a period is over, or the goal is another."""
        if super().opens():
            self.begin()
            return True
        if (self.now_ns - self._since_ns) / NANOSECONDS < self._period_s:
            return False
        self._since_ns, self._period_s = self.now_ns, 1.0 / self._rate()
        return True

    def _rate(self) -> float:
        least, most = number(self, "min_rate"), number(self, "max_rate")
        slowest, fastest = number(self, "min_speed"), number(self, "max_speed")
        share = (self.speed() - slowest) / (fastest - slowest) if fastest != slowest else 1.0
        return max(min(share * (most - least) + least, most), least)


class SingleTrigger(Decorator):
    """Ticks its child until it has ended once, and fails from then on until it is begun anew."""

    remembers = ("_over",)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the child, or fail."""
        return children[0] | FAILS

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
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


class GoalUpdater(Decorator):
    """Ticks its child with the newest goal, here always the one that it was given."""

    ports = (
        input_port("input_goal", doc="the goal so far", optional=True),
        input_port("input_goals", doc="the goals so far", optional=True),
        output_port("output_goal", doc="the newest goal"),
        output_port("output_goals", doc="the newest goals"),
    )

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the child."""
        return children[0]

    def update(self) -> Answer:
        """Hand the goal on, and tick the child."""
        for which in ("goal", "goals"):
            goal = read(self, f"input_{which}")
            if goal is not None:
                self.put(f"output_{which}", goal)
        return self.child.execute()


class PathLongerOnApproach(Decorator):
    """Ticks its child when a new path to the same goal is much longer and the goal is near; else it succeeds.

    A path is a sequence of points on the blackboard.
    """

    ports = (
        input_port("path", doc="the path", optional=True),
        input_port("prox_len", DOUBLE, "3.0", "the goal is near when the path to it is shorter", unit="m"),
        input_port("length_factor", DOUBLE, "2.0", "a path is much longer when it is so many times as long"),
    )

    remembers = ("_before",)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the child, or succeed."""
        return children[0] | SUCCEEDS

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._before: Sequence[Point] = ()

    def update(self) -> Answer:
        """Compare the paths, and tick."""
        self.become(RUNNING)
        before, path = self._before, self._path()
        if not (before and path and path != before and path[-1] == before[-1] and self._longer(path, before)):
            self._before = path
            return SUCCESS
        answer = self.child.execute()
        if answer is SUCCESS or answer is FAILURE:
            self._before = path
            self.reset_children()
        return answer

    def _path(self) -> Sequence[Point]:
        path = read(self, "path")
        return path if isinstance(path, Sequence) and not isinstance(path, str) else ()

    def _longer(self, path: Sequence[Point], before: Sequence[Point]) -> bool:
        return length_m(before) < number(self, "prox_len") and length_m(path) > number(self, "length_factor") * length_m(before)


def length_m(path: Sequence[Point]) -> float:
    """Return the length of a path."""
    return sum(math.dist(one, other) for one, other in itertools.pairwise(path))


def number(node: Node, port: str) -> float:
    """Return the value of an input that is a number."""
    value = node.get(port)
    return value if isinstance(value, float) else math.nan


def read(node: Node, port: str, entry: str = "") -> object:
    """Return the value of an input, that of an entry where the file does not give it; None where there is none."""
    if not node.given(port):
        return node.blackboard.get(entry) if entry else None
    known = node.entry(port)
    return known.value if known is not None else node.wiring.ports[port]
