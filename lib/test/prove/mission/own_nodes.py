"""Nodes of a robot's own with children, of the kinds that robots have: for tests of the search."""

from __future__ import annotations

import random
from typing import Any, ClassVar

from alula.missions.part import MissionPart
from alula.trees.node import Action, Control, Decorator, NodeConfig, SyncAction, register
from alula.trees.ports import input_port, output_port
from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer
from alula.trees.values import ANY, DOUBLE, INT

SECOND_NS = 1e9


@register("robot.Guard")
class Guard(Decorator):
    """Ticks its child."""

    def update(self) -> Answer:
        """Tick it."""
        return self.child.execute()


@register("robot.Limit")
class Limit(Decorator):
    """Begins its child once in a while only, and runs in between; declares nothing of what it remembers."""

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._since_ns: int | None = None

    def update(self) -> Answer:
        """Tick the child when enough time has passed."""
        self.become(RUNNING)
        if self.child.status is not RUNNING:
            if self._since_ns is not None and self.now_ns - self._since_ns < 0.2 * SECOND_NS:
                return RUNNING
            self._since_ns = self.now_ns
        answer = self.child.execute()
        return RUNNING if answer is SUCCESS else answer


@register("robot.Recovery")
class Recovery(Control):
    """As Nav2's: when the first child fails the second one is ticked, and then the first one again."""

    ports = (input_port("tries", INT, "2"),)
    child_count = (2, 2)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._tried = 0
        self._mends = False

    def update(self) -> Answer:
        """Tick the one whose turn it is, and the other as long as none runs."""
        self.become(RUNNING)
        while self._tried <= self.number("tries"):
            answer = self.children[1 if self._mends else 0].execute()
            if answer is RUNNING:
                return RUNNING
            if self._mends == (answer is FAILURE) or answer is SKIPPED:
                break
            if not self._mends and answer is SUCCESS:
                self.halt()
                return SUCCESS
            self.reset_child(1 if self._mends else 0)
            self._tried += self._mends
            self._mends = not self._mends
        self.halt()
        return FAILURE

    def halt(self) -> None:
        """Begin anew."""
        super().halt()
        self._tried, self._mends = 0, False


@register("robot.ByTurns")
class ByTurns(Control):
    """Ticks another child each time that it begins, through a function of its own that knows the last one."""

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._done: list[int] = []

    @property
    def turn(self) -> int:
        """Whose turn it is."""
        return following(self._done[-1] if self._done else -1, len(self.children))

    def update(self) -> Answer:
        """Tick it."""
        turn = self.turn
        answer = self.children[turn].execute()
        if answer is not RUNNING and answer is not SKIPPED:
            self._done = [turn]
            self.reset_children()
        return answer


def following(last: int, count: int) -> int:
    """Return the next one, the first after the last."""
    return (last + 1) % count


@register("robot.Careless")
class Careless(Control):
    """Succeeds when all of its children have begun, and leaves them running, also when it is halted."""

    def update(self) -> Answer:
        """Begin one after another."""
        for child in self.children:
            if child.status is IDLE:
                return RUNNING if child.execute() is not FAILURE else FAILURE
        return SUCCESS

    def halt(self) -> None:
        """Leave all as it is."""
        self.become(IDLE)


@register("robot.Moody")
class Moody(Control):
    """Does anything with its children, by chance, and answers anything."""

    ports = (output_port("number", INT),)
    chance: ClassVar[random.Random] = random.Random(0)  # noqa: S311 - for tests

    def update(self) -> Answer:
        """Do anything."""
        for _ in range(self.chance.randrange(5)):
            which = self.chance.randrange(len(self.children))
            if self.chance.random() < 0.7:
                self.children[which].execute()
            else:
                self.reset_child(which)
        if self.chance.random() < 0.3:
            self.put("number", self.chance.randrange(4))
        if self.chance.random() < 0.3:
            self.become(RUNNING)
        return self.chance.choice((SUCCESS, FAILURE, RUNNING, RUNNING, SKIPPED))

    def halt(self) -> None:
        """Halt some of them."""
        for which in range(len(self.children)):
            if self.chance.random() < 0.5:
                self.reset_child(which)
        self.become(IDLE)


@register("robot.Counted")
class Counted(Decorator):
    """Ticks its child as many times as a number says that only the world knows."""

    ports = (input_port("many", INT),)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._count = 0

    def update(self) -> Answer:
        """Tick it again, or end."""
        if self._count >= self.number("many"):
            self._count = 0
            return SUCCESS
        answer = self.child.execute()
        if answer is SUCCESS:
            self._count += 1
        return RUNNING if answer is SUCCESS else answer


@register("robot.Seldom")
class Seldom(Decorator):
    """Ticks its child in each tick of a hundred, and counts all of them."""

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self.ticks = 0

    def update(self) -> Answer:
        """Count, and tick."""
        self.ticks += 1
        return self.child.execute() if self.child.status is RUNNING or self.ticks % 7 == 0 else RUNNING


@register("robot.Shy")
class Shy(Action):
    """A leaf that may be skipped."""

    def on_start(self) -> Answer:
        """Be skipped, or run."""
        return Moody.chance.choice((SKIPPED, RUNNING, SUCCESS))

    def on_running(self) -> Answer:
        """End, or not."""
        return Moody.chance.choice((RUNNING, SUCCESS, FAILURE))

    def on_halted(self) -> None:
        """Nothing is to be done."""


RUN = {"robot.Guard": Guard, "robot.Limit": Limit, "robot.Recovery": Recovery, "robot.ByTurns": ByTurns, "robot.Careless": Careless}
"""Those whose class the search runs."""
ANYHOW = {"robot.Moody": Moody, "robot.Counted": Counted, "robot.Seldom": Seldom}
"""Those that may do anything there."""
PART = MissionPart((*RUN.values(), *ANYHOW.values(), Shy))


@register("robot.Place")
class Place(SyncAction):
    """Computes with what it is given: succeeds where that is near."""

    ports = (input_port("seen", ANY), output_port("far", DOUBLE))

    def update(self) -> Answer:
        """Compute."""
        seen: Any = self.get("seen")
        self.put("far", float(seen["x"] + 1))
        return SUCCESS if seen["x"] < 3 else FAILURE
