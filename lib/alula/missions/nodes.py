"""Nodes of missions that BehaviorTree.CPP has not: they wait on conditions, with the mission's clock."""

from __future__ import annotations

import math
from collections.abc import Sequence

from alula.missions.context import MissionContext
from alula.trees.ends import ENDS, FAILS, SUCCEEDS, Ends, Given, whole_number
from alula.trees.errors import TickError
from alula.trees.node import Action, Condition, Count, Decorator, NodeConfig, Script, SyncAction
from alula.trees.ports import input_port, script_port
from alula.trees.registry import NodeRegistry
from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer
from alula.trees.ticking import AGAIN, Order, Ticking
from alula.trees.values import DOUBLE, INT, STRING

IF = script_port("if", "a script that says yes or no")
SECOND_NS = 1e9
FOR_EVER = -1
"""A count that is none."""


def asked(node: Action | Condition | Decorator, port: str = "if") -> Script:
    """Return the script of a port."""
    return node.config.compile(node.config.ports.get(port, "true"), port)


def holds(node: Action, script: Script) -> bool:
    """Ask; where nobody knows, the node says why."""
    answer = script.holds()
    node.feedback_message = script.unknown
    return answer


class WaitFor(Action):
    """Runs until a condition holds."""

    ports = (IF,)
    answers_by = "if"
    ends = SUCCEEDS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._script = asked(self)

    def on_start(self) -> Answer:
        """Look."""
        return self.on_running()

    def on_running(self) -> Answer:
        """Look."""
        return SUCCESS if holds(self, self._script) else RUNNING


class Stays(Action):
    """Succeeds when a condition has held for a time without a break, fails as soon as it does not."""

    ports = (IF, input_port("for", DOUBLE, doc="how long", unit="s"))
    answers_by = "if"
    ends = ENDS

    remembers_running = ("_since_ns",)

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._script = asked(self)
        self._since_ns = 0

    def on_start(self) -> Answer:
        """Begin to count."""
        self._since_ns = self.now_ns
        return self.on_running()

    def on_running(self) -> Answer:
        """Look and count."""
        if not holds(self, self._script):
            return FAILURE
        return SUCCESS if self.now_ns - self._since_ns >= seconds_ns(self, "for") else RUNNING


class Awaits(Action):
    """Succeeds when a condition has held for a time without a break, fails when it has not within another."""

    ports = (
        IF,
        input_port("within", DOUBLE, doc="how long to wait", unit="s"),
        input_port("for", DOUBLE, "0", "how long it holds", unit="s"),
    )
    answers_by = "if"
    ends = ENDS

    remembers_running = ("_since_ns", "_holds_since_ns")

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._script = asked(self)
        self._since_ns = 0
        self._holds_since_ns: int | None = None

    def on_start(self) -> Answer:
        """Begin to count."""
        self._since_ns, self._holds_since_ns = self.now_ns, None
        return self.on_running()

    def on_running(self) -> Answer:
        """Look and count."""
        now_ns = self.now_ns
        if not holds(self, self._script):
            self._holds_since_ns = None
        elif self._holds_since_ns is None:
            self._holds_since_ns = now_ns
        if self._holds_since_ns is not None and now_ns - self._holds_since_ns >= seconds_ns(self, "for"):
            return SUCCESS
        return RUNNING if now_ns - self._since_ns < seconds_ns(self, "within") else FAILURE


class Until(Decorator):
    """Runs its child again, a tick after it has succeeded, until a condition holds after a success; fails with its child."""

    ports = (IF,)
    may_run = True
    ticking = Ticking(Order.SINGLE, after={SUCCESS: frozenset({*SUCCEEDS, AGAIN})})

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._script = asked(self)

    def update(self) -> Answer:
        """Follow the child."""
        self.become(RUNNING)
        answer = self.child.execute()
        if answer is RUNNING or answer is SKIPPED:
            return answer
        self.reset_children()
        return FAILURE if answer is FAILURE else SUCCESS if self._script.holds() else RUNNING


class RetryAfter(Decorator):
    """Gives its child another chance some time after a failure, when a condition holds then.

    ``attempts`` counts as ``num_attempts`` of RetryUntilSuccessful: with 0 or less it fails at once, but -1 is for ever.
    """

    ticking = Ticking(Order.SINGLE, after={FAILURE: frozenset({*FAILS, AGAIN})}, rounds="attempts")
    ports = (
        IF,
        input_port("attempts", INT, "2", "how many chances it has in all; -1: any number"),
        input_port("wait", DOUBLE, "0", "how long after the failure", unit="s"),
    )
    may_run = True

    remembers_running = ("_left", "_again_ns")
    counts = (Count("_left", "the attempts left", down=True),)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:
        """End as the child; fail without it where the number may leave no chance."""
        attempts = whole_number(given, cls.ticking.rounds)
        return children[0] if attempts is not None and (attempts > 0 or attempts == FOR_EVER) else children[0] | FAILS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._script = asked(self)
        self._left = 0
        self._again_ns: int | None = None

    def update(self) -> Answer:
        """Wait for the next chance, or follow the child."""
        if self.status is IDLE:
            attempts = self.number(self.ticking.rounds)
            self._left, self._again_ns, self.feedback_message = attempts if attempts >= FOR_EVER else 0, None, ""
        self.become(RUNNING)
        if not self._left:
            return FAILURE
        if self._again_ns is not None and self.now_ns < self._again_ns:
            return RUNNING
        self._again_ns = None
        answer = self.child.execute()
        if answer is not FAILURE:
            return answer
        self.reset_children()
        if self._left != FOR_EVER:
            self._left -= 1
        if not self._script.holds() or not self._left:  # a search of all runs need not count where there is none
            return FAILURE
        wait_ns = seconds_ns(self, "wait")
        self._again_ns = self.now_ns + wait_ns
        self.feedback_message = f"tries again after {wait_ns / SECOND_NS:g} s"
        return RUNNING


class Needs(Condition):
    """What a mission needs to start: its name says it, ``otherwise`` is a script of a text that says what is so instead."""

    ports = (IF, script_port("otherwise", "a script of a text"))
    ends = ENDS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._script = asked(self)
        self._otherwise = asked(self, "otherwise")

    @property
    def unmet(self) -> str:
        """What is so instead; empty when it is as it has to be."""
        return "" if self._script.holds() else str(self._otherwise.run())

    def update(self) -> Answer:
        """Ask."""
        self.feedback_message = self.unmet
        return FAILURE if self.feedback_message else SUCCESS


class NoteReason(SyncAction):
    """Keeps what went wrong up to here as the mission's reason; or, with a text, adds that to what went wrong: no skill reports it."""

    ports = (input_port("text", STRING, "", "what went wrong; empty: what the skills reported"),)
    ends = SUCCEEDS
    context: MissionContext

    def update(self) -> Answer:
        """Keep it."""
        text = str(self.get("text"))
        if text:
            self.context.note(text)
        else:
            self.context.note_reason()
        return SUCCESS


def seconds_ns(node: Action | Decorator, port: str) -> int:
    """Return a port that is a time in seconds; raises TickError where it is no number."""
    value = node.get(port)
    if not isinstance(value, float) or not math.isfinite(value):
        raise TickError(f"{node.place()}: the port '{port}' is {value}, no time in seconds")
    return int(value * SECOND_NS)


def mission_nodes(context: MissionContext) -> NodeRegistry:
    """Return them."""
    registry = NodeRegistry()
    for node in (WaitFor, Stays, Awaits, Until, RetryAfter, Needs):
        registry.register(node)
    noting: type[NoteReason] = type("NoteReason", (NoteReason,), {"context": context, "__doc__": NoteReason.__doc__})
    registry.register(noting)
    return registry
