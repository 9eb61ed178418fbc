"""Nodes that tick their children one after the other."""

from __future__ import annotations

from typing import ClassVar

from alula.trees.node import Control, Wiring
from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer, Status


class _InTurn(Control):
    """Ticks the children in turn, and goes on in the next tick with the one that runs.

    ``goes_on`` with the next child after this answer; the other one ends it. All skipped: it is skipped itself.
    """

    goes_on: ClassVar[Status] = SUCCESS
    gives_way: ClassVar[bool] = False
    """After a child that has ended in its first tick it answers RUNNING, so that it can be halted between quick children."""

    remembers = ("_index", "_skipped")

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._index = 0
        self._skipped = 0

    def update(self) -> Answer:
        """Tick the child whose turn it is, and those after it as long as they end."""
        if self.status is IDLE:
            self._skipped = 0
        self.become(RUNNING)
        children = self.children
        while self._index < len(children):
            child = children[self._index]
            fresh = child.status is IDLE
            answer = child.execute()
            if answer is RUNNING:
                return RUNNING
            if answer is SKIPPED:
                self._skipped += 1
            elif answer is not self.goes_on:
                self._leave()
                return answer
            self._index += 1
            if self.gives_way and fresh and answer is not SKIPPED and self._index < len(children):
                return self.give_way()
        skipped = self._skipped == len(children)
        self.reset_children()
        self._index = self._skipped = 0
        return SKIPPED if skipped else self.goes_on

    def halt(self) -> None:
        """Begin with the first child the next time."""
        self._index = self._skipped = 0
        super().halt()

    def _leave(self) -> None:
        self.reset_children()
        self._index = 0


class Sequence(_InTurn):
    """Ticks its children one after the other until one fails; succeeds with the last."""


class Fallback(_InTurn):
    """Ticks its children one after the other until one succeeds; fails with the last."""

    goes_on = FAILURE


class AsyncSequence(Sequence):
    """A Sequence that can be halted between children that end at once."""

    gives_way = True


class AsyncFallback(Fallback):
    """A Fallback that can be halted between children that end at once."""

    gives_way = True


class SequenceWithMemory(_InTurn):
    """A Sequence that begins again with the child that failed, also after it was halted."""

    gives_way = True

    def halt(self) -> None:
        """Halt what runs, and keep the place."""
        Control.halt(self)

    def _leave(self) -> None:
        self.reset_children(self._index)


class _Reactive(Control):
    """Ticks all children from the first in each tick; the first that runs has the others halted."""

    goes_on: ClassVar[Status] = SUCCESS

    def update(self) -> Answer:
        """Tick them until one runs, or ends it."""
        self.become(RUNNING)
        skipped = True
        for index, child in enumerate(self.children):
            answer = child.execute()
            if answer is RUNNING:
                for other in range(len(self.children)):
                    if other != index:
                        self.reset_child(other)
                return RUNNING
            if answer is SKIPPED:
                self.reset_child(index)
                continue
            skipped = False
            if answer is not self.goes_on:
                self.reset_children()
                return answer
        self.reset_children()
        return SKIPPED if skipped else self.goes_on


class ReactiveSequence(_Reactive):
    """A Sequence that asks its first children again in each tick; for conditions before one action."""


class ReactiveFallback(_Reactive):
    """A Fallback that asks its first children again in each tick."""

    goes_on = FAILURE
