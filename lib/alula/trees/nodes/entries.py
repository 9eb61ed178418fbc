"""Nodes that write entries of the blackboard, or ask whether they were written."""

from __future__ import annotations

from typing import ClassVar

from alula.trees.errors import TickError
from alula.trees.node import Decorator, SyncAction, Wiring, pointer
from alula.trees.palette import inout_port, input_port
from alula.trees.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Answer
from alula.trees.values import ANY, STRING, PortType


class SetBlackboard(SyncAction):
    """Writes a value, or what another entry has, into an entry."""

    ports = (input_port("value", doc="what is written"), inout_port("output_key", doc="the entry's name"))

    def update(self) -> Answer:
        """Write."""
        key, text = str(self.get("output_key")), self.wiring.ports.get("value", "")
        source = pointer(text, "value")
        value: object = text
        type_: PortType = STRING
        if source is not None:
            entry = self.blackboard.entry(source)
            if entry is None:
                raise TickError(f"{self.place()}: the blackboard has no entry '{source}'")
            if self.blackboard.entry(key) is None:
                self.blackboard.create(key, entry.type)
            value, type_ = entry.value, entry.type
        if value is None:
            return FAILURE
        self.blackboard.set(key, value, type_)
        return SUCCESS


class UnsetBlackboard(SyncAction):
    """Takes an entry away."""

    ports = (input_port("key", STRING, doc="the entry's name"),)

    def update(self) -> Answer:
        """Take it away."""
        self.blackboard.unset(str(self.get("key")))
        return SUCCESS


ENTRY = (input_port("entry", ANY, doc="the entry, as {entry}"),)


class WasEntryUpdated(SyncAction):
    """Succeeds when an entry was written since this node asked last."""

    ports = ENTRY

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
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

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
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

    otherwise = SKIPPED


class WaitValueUpdate(_IfUpdated):
    """Waits until an entry is written, then ticks its child."""

    otherwise = RUNNING
