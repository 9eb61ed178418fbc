"""Nodes that choose one of their children."""

from __future__ import annotations

from collections.abc import Sequence

from alula.trees.ends import FAILS, NO_END, Ends, Given, together
from alula.trees.errors import TickError
from alula.trees.node import Control, NodeConfig
from alula.trees.ports import input_port
from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer
from alula.trees.ticking import Order, Ticking
from alula.trees.values import BOOL, STRING, StandIn

EPSILON = 2.0**-23
"""Of a C float: within it two numbers are one."""


class _Chooses(Control):
    """Ticks the second child after a success of the first, the third after its failure; fails where it has none."""

    child_count = (2, 3)
    may_run = False

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as what is chosen; a condition that is skipped raises."""
        asked, then, *otherwise = children
        failed = otherwise[0] if otherwise else FAILS
        return (then if SUCCESS in asked else NO_END) | (failed if FAILURE in asked else NO_END)


class IfThenElse(_Chooses):
    """Ticks the first child until it has ended; then the second if it succeeded, else the third, and answers as that one."""

    ticking = Ticking(Order.CHOSEN)
    remembers = ("_chosen",)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._chosen = 0

    def update(self) -> Answer:
        """Ask, or follow what was chosen."""
        self.become(RUNNING)
        if not self._chosen:
            answer = self.children[0].execute()
            if answer is RUNNING:
                return RUNNING
            if answer is FAILURE and len(self.children) == 2:
                return FAILURE
            if answer is SKIPPED:
                raise TickError(f"{self.place()}: its condition was skipped, so there is nothing to choose by")
            self._chosen = 1 if answer is SUCCESS else 2
        answer = self.children[self._chosen].execute()
        if answer is not RUNNING:
            self.reset_children()
            self._chosen = 0
        return answer

    def halt(self) -> None:
        """Ask again the next time."""
        self._chosen = 0
        super().halt()


class WhileDoElse(_Chooses):
    """Asks the first child in each tick: the second runs while it succeeds, the third while it fails."""

    ticking = Ticking(Order.CHOSEN_EACH_TICK)

    def update(self) -> Answer:
        """Ask, and tick one of the others."""
        self.become(RUNNING)
        asked = self.children[0].execute()
        if asked is RUNNING:
            return RUNNING
        if asked is SKIPPED:
            self.reset_children()
            raise TickError(f"{self.place()}: its condition was skipped, so there is nothing to choose by")
        chosen = 1 if asked is SUCCESS else 2
        answer: Answer = FAILURE
        if chosen < len(self.children):
            if len(self.children) == 3:
                self.reset_child(3 - chosen)
            answer = self.children[chosen].execute()
        if answer is not RUNNING:
            self.reset_children()
        return answer


class Switch(Control):
    """Ticks the child of the case that equals the variable, else the last child; asks again in each tick."""

    may_run = False
    ticking = Ticking(Order.PICKED)
    remembers = ("_running",)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as any of them."""
        return together(children)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._running: int | None = None

    def update(self) -> Answer:
        """Choose, halt what was chosen before, and tick."""
        chosen = self._chosen()
        if self._running not in {None, chosen}:
            self.reset_child(self._running or 0)
        answer = self.children[chosen].execute()
        self._running = chosen if answer is RUNNING else None
        if answer is SUCCESS or answer is FAILURE:
            self.reset_children()
        return answer

    def halt(self) -> None:
        """Choose anew the next time."""
        self._running = None
        super().halt()

    def _chosen(self) -> int:
        last = len(self.children) - 1
        variable = self._text("variable")
        if variable is not None:
            for index in range(last):
                case = self._text(f"case_{index + 1}")
                if case is not None and equal(variable, case, self.config.enums):
                    return index
        return last

    def _text(self, port: str) -> str | None:
        try:
            return str(self.get(port))
        except TickError:
            return None


def equal(one: str, other: str, enums: object) -> bool:
    """Return whether two texts are the same text, the same enumerator, or the same number."""
    if one == other:
        return True
    if isinstance(one, StandIn) or isinstance(other, StandIn):
        return any(isinstance(unknown, StandIn) and _said(unknown, text, enums) for unknown, text in ((one, other), (other, one)))
    numbers = [_number(text, enums) for text in (one, other)]
    return None not in numbers and abs((numbers[0] or 0.0) - (numbers[1] or 0.0)) <= EPSILON


def _said(unknown: StandIn, text: str, enums: object) -> bool:
    """Return whether a text that nobody knows says the number that another one says; of two that nobody knows, enough was asked."""
    number = None if isinstance(text, StandIn) else _number(text, enums)
    return number is not None and unknown.says(number)


def _number(text: str, enums: object) -> float | None:
    if isinstance(enums, dict) and text in enums:
        return float(enums[text])
    try:
        return float(text)
    except ValueError:
        return None


def _switch(cases: int) -> type[Switch]:
    ports = [input_port("variable", STRING, doc="what is compared")]
    ports += [input_port(f"case_{number}", STRING, doc=f"of child {number}") for number in range(1, cases + 1)]
    content = {"ports": tuple(ports), "child_count": (cases + 1, cases + 1), "__doc__": Switch.__doc__, "__module__": __name__}
    return type(f"Switch{cases}", (Switch,), content)


SWITCHES = tuple(_switch(cases) for cases in range(2, 7))


class TryCatch(Control):
    """Ticks all but the last child as a Sequence; when one fails, the last one cleans up, and it fails."""

    child_count = (2, None)
    may_run = True
    ticking = Ticking(Order.TRIED)
    ports = (input_port("catch_on_halt", BOOL, "false", "have the last child tick once when it is halted, too"),)

    remembers = ("_index", "_skipped", "_cleans_up")

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._index = 0
        self._skipped = 0
        self._cleans_up = False

    def update(self) -> Answer:
        """Go on with the sequence, or clean up."""
        if self.status is IDLE:
            self._skipped = 0
            self._cleans_up = False
        self.become(RUNNING)
        if not self._cleans_up:
            answer = self._try()
            if not self._cleans_up:
                return answer
        if self.children[-1].execute() is RUNNING:
            return RUNNING
        self.reset_children()
        self._forget()
        return FAILURE

    def _try(self) -> Answer:
        last = len(self.children) - 1
        while self._index < last:
            answer = self.children[self._index].execute()
            if answer is RUNNING:
                return RUNNING
            if answer is FAILURE:
                self.reset_children()
                self._index = 0
                self._cleans_up = True
                return RUNNING
            self._skipped += answer is SKIPPED
            self._index += 1
        skipped = self._skipped == last
        self.reset_children()
        self._forget()
        return SKIPPED if skipped else SUCCESS

    def halt(self) -> None:
        """Clean up for one tick when it is asked for, and begin with the first child the next time."""
        if self.status is RUNNING and not self._cleans_up and self.get("catch_on_halt"):
            for index in range(len(self.children) - 1):
                self.reset_child(index)
            self.children[-1].execute()
        self._forget()
        super().halt()

    def _forget(self) -> None:
        self._index = self._skipped = 0
        self._cleans_up = False
