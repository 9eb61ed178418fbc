"""Nav2's nodes with several children."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from alula.trees.ends import ENDS, FAILS, NO_END, SKIPS, SUCCEEDS, Ends, Given, stops_at, together
from alula.trees.errors import TickError
from alula.trees.node import Control, Count, NodeConfig
from alula.trees.ports import inout_port, input_port
from alula.trees.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Answer
from alula.trees.ticking import Order, Ticking
from alula.trees.values import BOOL, INT


class PipelineSequence(Control):
    """Ticks its children in order, and those before the one that runs again in each tick, until the last one succeeds."""

    ticking = Ticking(Order.EACH_TICK, SUCCESS)
    may_run = False
    remembers = ("_reached",)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """Fail with a child, or get past all."""
        last = stops_at(children, SUCCESS)
        failed = together(children[: None if last is None else last + 1]) & FAILS
        return failed if last is not None else failed | SUCCEEDS | (together(children) & SKIPS)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._reached = 0

    def update(self) -> Answer:
        """Tick all children up to the first that runs and has not been passed before."""
        skipped = 0
        for index, child in enumerate(self.children):
            answer = child.execute()
            if answer is FAILURE:
                return self._over(FAILURE)
            if answer is RUNNING and index >= self._reached:
                self._reached = index
                return RUNNING
            skipped += answer is SKIPPED
        return self._over(SKIPPED if skipped == len(self.children) else SUCCESS)

    def halt(self) -> None:
        """Halt, and begin with the first child."""
        super().halt()
        self._reached = 0

    def _over(self, answer: Answer) -> Answer:
        self.reset_children()
        self._reached = 0
        return answer


def natural(node: Control, port: str) -> int:
    """Return the value of an input that counts something; raises TickError where it is less than 0, of which Nav2 has no meaning."""
    value = node.number(port)
    if value < 0:
        raise TickError(f"{node.place()}: the port '{port}' is {value}, and has to be 0 or more")
    return value


class RecoveryNode(Control):
    """Ticks its first child; when that fails the second one, and then the first one again, so many times."""

    ports = (input_port("number_of_retries", INT, "1", "how often the second child is tried"),)
    child_count = (2, 2)

    remembers = ("_recovers", "_retries")
    counts = (Count("_retries", "the retries"),)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the first child, or fail."""
        return children[0] | FAILS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._recovers = False
        self._retries = 0

    def update(self) -> Answer:
        """Tick the child whose turn it is, and go on with the other one as long as none runs."""
        self.become(RUNNING)
        most = natural(self, "number_of_retries")
        while self._retries <= most:
            answer = self._recover() if self._recovers else self._try(last=self._retries >= most)
            if answer is not None:
                return answer
        self.halt()
        return FAILURE

    def halt(self) -> None:
        """Halt, and begin with the first child and all retries."""
        super().halt()
        self._recovers, self._retries = False, 0

    def _try(self, *, last: bool) -> Answer | None:
        answer = self.children[0].execute()
        if answer is RUNNING:
            return RUNNING
        if answer is FAILURE and not last:
            self.reset_child(0)
            self._recovers = True
            return None
        self.halt()
        return answer

    def _recover(self) -> Answer | None:
        answer = self.children[1].execute()
        if answer is RUNNING:
            return RUNNING
        if answer is FAILURE:
            self.halt()
            return FAILURE
        self.reset_child(1)
        self._recovers = False
        if answer is SKIPPED:  # no recovery is possible, and none was tried
            return FAILURE
        self._retries += 1
        return None


class RoundRobin(Control):
    """Ticks its children by turns, one a success: the next time the one after it is the first."""

    ports = (input_port("wrap_around", BOOL, "false", "whether the first child is tried again after the last one"),)

    ticking = Ticking(Order.FROM_ANY, FAILURE)
    remembers = ("_turn", "_failed")

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """Be skipped where all are, else succeed or fail."""
        return ENDS | (SKIPS if all(child & SKIPS for child in children) else NO_END)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._turn = self._failed = 0

    def update(self) -> Answer:
        """Tick the child whose turn it is, and those after it until one does not fail."""
        self.become(RUNNING)
        skipped, over = 0, False
        while not over and self._failed + skipped < len(self.children):
            answer = self.children[self._turn].execute()
            if answer is RUNNING:
                return RUNNING
            self._turn = (self._turn + 1) % len(self.children)
            over = self._turn == 0 and not self.get("wrap_around")
            if answer is SUCCESS:
                self._failed = 0
                self.reset_children()
                return SUCCESS
            skipped += answer is SKIPPED
            self._failed += answer is FAILURE
        self.halt()
        return SKIPPED if skipped == len(self.children) else FAILURE

    def halt(self) -> None:
        """Halt, and begin with the first child."""
        super().halt()
        self._turn = self._failed = 0


class NonblockingSequence(Control):
    """Ticks all children in each tick, also those after one that runs, until all succeed at once."""

    ticking = Ticking(Order.EACH_TICK, SUCCESS)
    may_run = False
    ends = ENDS

    @classmethod
    def never_ticked(cls, given: Given, children: Sequence[Ends]) -> Iterator[tuple[int, int]]:  # noqa: ARG003
        """Yield none: while one runs, those after it are ticked, too."""
        yield from ()

    def update(self) -> Answer:
        """Tick all, up to one that fails; raises TickError at one that is skipped, which Nav2 does not allow here."""
        done = True
        for child in self.children:
            answer = child.execute()
            if answer is FAILURE:
                self.reset_children()
                return FAILURE
            if answer is SKIPPED:
                raise TickError(f"{self.place()}: '{child.name}' is skipped, which a NonblockingSequence can't be ticked with")
            done = done and answer is SUCCESS
        if not done:
            return RUNNING
        self.reset_children()
        return SUCCESS


class PersistentSequence(Control):
    """A sequence that goes on where it was, also after a halt: the index of its child is on the blackboard."""

    ports = (inout_port("current_child_idx", INT, None, "index of the current child"),)
    ticking = Ticking(Order.FROM_ANY, SUCCESS)
    ends = ENDS

    def update(self) -> Answer:
        """Tick from the current child on."""
        index = natural(self, "current_child_idx")
        self.become(RUNNING)
        while index < len(self.children):
            answer = self.children[index].execute()
            if answer is RUNNING:
                return RUNNING
            if answer is FAILURE:
                break
            index += 1
            self.put("current_child_idx", index)
        self.reset_children()
        self.put("current_child_idx", 0)
        return SUCCESS if index >= len(self.children) else FAILURE


class PauseResumeController(Control):
    """Ticks its first child until services ask for a pause; the others are for the pause (while it lasts, when it begins, when it ends)."""

    child_count = (1, 4)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the first child; where that is skipped it succeeds."""
        return (children[0] & ENDS) | (SUCCEEDS if children[0] & SKIPS else NO_END)
