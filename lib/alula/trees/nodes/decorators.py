"""Nodes with one child: what it answers, how often it is ticked, and when."""

from __future__ import annotations

from collections.abc import Sequence

from alula.trees.ends import FAILS, SKIPS, SUCCEEDS, Ends, Given, answer_in, whole_number
from alula.trees.node import NANOSECONDS_PER_MS, Count, Decorator, NodeConfig, Script
from alula.trees.ports import input_port, script_port
from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer, Status
from alula.trees.ticking import AGAIN, Begin, Order, Steps, Ticking
from alula.trees.values import BOOL, INT, STATUS, UINT

ONCE_MORE: Steps = frozenset({AGAIN})


class _Changed(Decorator):
    """Answers something else than its child."""

    may_run = False

    def update(self) -> Answer:
        """Tick the child."""
        self.become(RUNNING)
        answer = self.child.execute()
        if answer is SUCCESS or answer is FAILURE:
            self.reset_children()
            return self._instead(answer)
        return answer

    def _instead(self, answer: Status) -> Status:
        """Return what it answers when the child has ended."""
        raise NotImplementedError


class Inverter(_Changed):
    """Fails when its child succeeds, and the other way round."""

    ticking = Ticking(Order.SINGLE, after={SUCCESS: FAILS, FAILURE: SUCCEEDS})

    def _instead(self, answer: Status) -> Status:
        return SUCCESS if answer is FAILURE else FAILURE


class ForceSuccess(_Changed):
    """Succeeds when its child has ended."""

    ticking = Ticking(Order.SINGLE, after={FAILURE: SUCCEEDS})

    def _instead(self, answer: Status) -> Status:  # noqa: ARG002
        return SUCCESS


class ForceFailure(_Changed):
    """Fails when its child has ended."""

    ticking = Ticking(Order.SINGLE, after={SUCCESS: FAILS}, takes_failure=True)

    def _instead(self, answer: Status) -> Status:  # noqa: ARG002
        return FAILURE


class KeepRunningUntilFailure(_Changed):
    """Runs its child again and again, and fails with it."""

    may_run = True
    ticking = Ticking(Order.SINGLE, after={SUCCESS: ONCE_MORE, SKIPPED: ONCE_MORE}, takes_failure=True)

    def _instead(self, answer: Status) -> Status:
        return RUNNING if answer is SUCCESS else FAILURE

    def update(self) -> Answer:
        """Tick the child; one that is skipped is asked again in the next tick."""
        answer = super().update()
        return RUNNING if answer is SKIPPED else answer


class _Again(Decorator):
    """Ticks its child again after one of its answers, so often at most; the count survives skipping."""

    may_run = False
    remembers = ("_count",)
    counts = (Count("_count", "the rounds"),)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._count = 0

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:
        """End as the child; but for ever never so that it would go on, and so without the child where the number may be 0."""
        number, again = whole_number(given, cls.ticking.rounds), frozenset({cls.ticking.goes_on})
        if number == -1:
            return children[0] - again
        return children[0] | (again if number is None or number <= 0 else frozenset())

    def update(self) -> Answer:
        """Tick the child as long as it ends and is to begin again."""
        port, again = self.ticking.rounds, self.ticking.goes_on
        most = self.number(port)
        self.become(RUNNING)
        more = self._count < most or most == -1
        while more:
            fresh = self.child.status is IDLE
            answer = self.child.execute()
            if answer is RUNNING:
                return RUNNING
            self.reset_children()
            if answer is SKIPPED:
                return SKIPPED
            if answer is not again:
                self._count = 0
                return answer
            self._count += 1
            most = self.number(port) if again is FAILURE else most
            more = self._count < most or most == -1
            if fresh and more:
                return self.give_way()
        self._count = 0
        return again

    def halt(self) -> None:
        """Count anew the next time."""
        self._count = 0
        super().halt()


class Repeat(_Again):
    """Runs its child so many times as long as it succeeds; -1: for ever."""

    ticking = Ticking(Order.SINGLE, SUCCESS, after={SUCCESS: ONCE_MORE | SUCCEEDS}, rounds="num_cycles")
    ports = (input_port("num_cycles", INT, doc="how often; -1: for ever"),)


class RetryUntilSuccessful(_Again):
    """Runs its child so many times until it succeeds; -1: for ever."""

    ticking = Ticking(Order.SINGLE, FAILURE, after={FAILURE: ONCE_MORE | FAILS}, rounds="num_attempts")
    ports = (input_port("num_attempts", INT, doc="how often; -1: for ever"),)


class RunOnce(Decorator):
    """Runs its child once in the life of the tree."""

    ports = (input_port("then_skip", BOOL, "true", "skip afterwards; else answer as the first time"),)

    may_run = False
    ticking = Ticking(Order.SINGLE, begins=Begin.PERHAPS)
    remembers = ("_answer",)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the child, or be skipped."""
        return children[0] | SKIPS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._answer: Answer | None = None

    def update(self) -> Answer:
        """Tick the child until it has ended once."""
        if self._answer is not None:
            return SKIPPED if self.get("then_skip") else self._answer
        self.become(RUNNING)
        answer = self.child.execute()
        if answer is SUCCESS or answer is FAILURE:
            self._answer = answer
            self.reset_children()
        return answer


class Precondition(Decorator):
    """Ticks its child when a script says yes; it is asked until the child runs."""

    ports = (script_port("if", "the script"), input_port("else", STATUS, "FAILURE", "what it answers when the script says no"))

    may_run = None
    ticking = Ticking(Order.SINGLE, begins=Begin.PERHAPS)
    remembers = ("_begun",)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:
        """End as the child, or as `else` says."""
        return children[0] | answer_in(given, "else")

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._begun = False
        self._text = ""
        self._script: Script | None = None

    def update(self) -> Answer:
        """Ask, and tick the child."""
        if not self._begun and not self._asked().holds():
            return _answer(self.get("else"))
        self._begun = True
        answer = self.child.execute()
        if answer is SUCCESS or answer is FAILURE:
            self.reset_children()
            self._begun = False
        return answer

    def _asked(self) -> Script:
        text = str(self.get("if"))
        if self._script is None or text != self._text:
            self._script, self._text = self.config.compile(text, "if"), text
        return self._script


def _answer(value: object) -> Answer:
    if isinstance(value, type(SUCCESS) | type(SKIPPED)):
        return value
    raise TypeError(value)


class Delay(Decorator):
    """Ticks its child after some time."""

    may_run = True

    ports = (input_port("delay_msec", UINT, doc="after how long", unit="ms"),)

    ticking = Ticking(Order.SINGLE, begins=Begin.LATER)
    remembers = ("_until_ns",)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._until_ns: int | None = None

    def update(self) -> Answer:
        """Wait, or tick the child."""
        if self._until_ns is None:
            self._until_ns = self.now_ns + self.number("delay_msec") * NANOSECONDS_PER_MS
            self.become(RUNNING)
        if self.now_ns < self._until_ns:
            return RUNNING
        answer = self.child.execute()
        if answer is SUCCESS or answer is FAILURE:
            self._until_ns = None
            self.reset_children()
        return answer

    def halt(self) -> None:
        """Wait anew the next time."""
        self._until_ns = None
        super().halt()


class Timeout(Decorator):
    """Halts its child and fails when it runs for longer; 0: never."""

    ports = (input_port("msec", UINT, doc="for how long at most", unit="ms"),)

    may_run = False
    ticking = Ticking(Order.SINGLE, cuts_off=FAILS)
    remembers = ("_until_ns",)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:
        """End as the child, or fail after the time."""
        return children[0] if whole_number(given, "msec") == 0 else super().may_end(given, children)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._until_ns: int | None = None

    def update(self) -> Answer:
        """Tick the child, or halt it when its time is over."""
        limit_ms = self.number("msec")
        if self._until_ns is None:
            self._until_ns = self.now_ns + limit_ms * NANOSECONDS_PER_MS
            self.become(RUNNING)
        elif limit_ms > 0 and self.now_ns >= self._until_ns and self.child.status is RUNNING:
            self._until_ns = None
            self.reset_children()
            return FAILURE
        answer = self.child.execute()
        if answer is SUCCESS or answer is FAILURE:
            self._until_ns = None
            self.reset_children()
        return answer

    def halt(self) -> None:
        """Count anew the next time."""
        self._until_ns = None
        super().halt()
