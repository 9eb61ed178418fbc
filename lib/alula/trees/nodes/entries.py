"""Nodes that write entries of the blackboard, or ask whether they were written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from alula.trees.blackboard import type_of
from alula.trees.ends import ENDS, SUCCEEDS, Ends, Given
from alula.trees.errors import TickError
from alula.trees.node import Decorator, NodeConfig, SyncAction, pointer
from alula.trees.ports import inout_port, input_port
from alula.trees.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Answer
from alula.trees.ticking import Begin, Order, Ticking
from alula.trees.values import ANY, STRING, shown


class SetBlackboard(SyncAction):
    """Writes a value, or what another entry has, into an entry."""

    ports = (input_port("value", doc="what is written"), replace(inout_port("output_key", doc="the entry's name"), written_from="value"))

    ends = ENDS

    def update(self) -> Answer:
        """Write."""
        key, text = str(self.get("output_key")), self.config.ports.get("value", "")
        known = self.blackboard.entry(key)
        source = pointer(text, "value")
        if source is None:
            self.blackboard.set(key, text, STRING if known is None else ANY)
            return SUCCESS
        entry = self.blackboard.entry(source)
        if entry is None:
            raise TickError(f"{self.place()}: the blackboard has no entry '{source}'")
        known = known or self.blackboard.create(key, entry.type)
        if entry.value is None:
            return FAILURE
        if known.type is not ANY and known.type is not type_of(entry.value):
            raise TickError(f"{self.place()}: the entry '{key}' is a {known.type.name}, and '{source}' is {shown(entry.value)}")
        self.blackboard.set(key, entry.value)
        return SUCCESS


class UnsetBlackboard(SyncAction):
    """Takes an entry away."""

    ports = (input_port("key", STRING, doc="the entry's name"),)
    takes_away = "key"

    ends = SUCCEEDS

    def update(self) -> Answer:
        """Take it away."""
        self.blackboard.unset(str(self.get("key")))
        return SUCCESS


ENTRY = (input_port("entry", ANY, doc="the entry, as {entry}", optional=True),)


class WasEntryUpdated(SyncAction):
    """Succeeds when an entry was written since this node asked last."""

    ports = ENTRY

    remembers = ("_seen",)
    watches: ClassVar[Mapping[str, str]] = {"_seen": "entry"}

    ends = ENDS

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._seen = 0

    def update(self) -> Answer:
        """Look at how often it was written."""
        entry = self.entry("entry")
        if entry is None:
            return FAILURE
        seen, self._seen = self._seen, entry.sequence
        return FAILURE if seen == entry.sequence else SUCCESS


class _IfUpdated(Decorator):
    """Ticks its child when an entry was written since it asked last."""

    ports = ENTRY
    otherwise: ClassVar[Answer]

    remembers = ("_seen", "_running")
    watches: ClassVar[Mapping[str, str]] = {"_seen": "entry"}

    ticking = Ticking(Order.SINGLE, begins=Begin.PERHAPS)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:  # noqa: ARG003
        """End as the child, or as it does without it."""
        return children[0] | (frozenset({cls.otherwise}) - {RUNNING})

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._seen = 0
        self._running = False

    def update(self) -> Answer:
        """Follow the child while it runs, else ask."""
        if not self._running:
            entry = self.entry("entry")
            if entry is None or entry.sequence == self._seen:
                return self.otherwise
            self._seen = entry.sequence
        answer = self.child.execute()
        self._running = answer is RUNNING
        return answer

    def halt(self) -> None:
        """Ask again the next time."""
        self._running = False
        super().halt()


class SkipUnlessUpdated(_IfUpdated):
    """Ticks its child when an entry was written since it asked last, else it is skipped."""

    may_run = False
    otherwise = SKIPPED


class WaitValueUpdate(_IfUpdated):
    """Waits until an entry is written, then ticks its child."""

    may_run = True
    ticking = Ticking(Order.SINGLE, begins=Begin.LATER)
    otherwise = RUNNING
