"""Nodes that tick their children one after the other."""

from __future__ import annotations

from collections.abc import Sequence as Listed
from dataclasses import replace

from alula.trees.ends import ENDS, NO_END, SKIPS, Ends, Given, stops_at, together
from alula.trees.node import Control, NodeConfig
from alula.trees.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Answer
from alula.trees.ticking import Order, Ticking


class _InTurn(Control):
    """Ticks the children in turn, and goes on in the next tick with the one that runs. All skipped: it is skipped itself.

    One that gives way answers RUNNING after a child that has ended in its first tick, so that it can be halted between quick children.
    """

    ticking = Ticking(Order.IN_TURN, SUCCESS, place="_index")
    may_run = False
    remembers = ("_index", "_skipped")

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._index = 0
        self._skipped = 0

    @classmethod
    def may_end(cls, given: Given, children: Listed[Ends]) -> Ends:  # noqa: ARG003
        """Go on or not with each. How many were skipped is kept after a child that ends it, where nobody resets it."""
        goes_on = cls.ticking.goes_on
        last = stops_at(children, goes_on)
        ticked = together(children[: None if last is None else last + 1])
        over = ticked & (ENDS - {goes_on})
        if last is not None:
            return over
        counts_on = bool(over or cls.ticking.keeps_place)
        passed = goes_on in ticked or (counts_on and bool(ticked & SKIPS))
        skipped = bool(over and ticked & SKIPS) or all(child & SKIPS for child in children)
        return over | (frozenset({goes_on}) if passed else NO_END) | (SKIPS if skipped else NO_END)

    def update(self) -> Answer:
        """Tick the child whose turn it is, and those after it as long as they end."""
        if self.status is IDLE:
            self._skipped = 0
        self.become(RUNNING)
        children, ticking = self.children, self.ticking
        while self._index < len(children):
            child = children[self._index]
            fresh = child.status is IDLE
            answer = child.execute()
            if answer is RUNNING:
                return RUNNING
            if answer is SKIPPED:
                self._skipped += 1
            elif answer is not ticking.goes_on:
                self._leave()
                return answer
            self._index += 1
            if ticking.gives_way and fresh and answer is not SKIPPED and self._index < len(children):
                return self.give_way()
        skipped = self._skipped == len(children)
        self.reset_children()
        self._index = self._skipped = 0
        return SKIPPED if skipped else ticking.goes_on

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

    ticking = replace(Sequence.ticking, goes_on=FAILURE)


class AsyncSequence(Sequence):
    """A Sequence that can be halted between children that end at once."""

    may_run = True
    ticking = replace(Sequence.ticking, gives_way=True)


class AsyncFallback(Fallback):
    """A Fallback that can be halted between children that end at once."""

    may_run = True
    ticking = replace(Fallback.ticking, gives_way=True)


class SequenceWithMemory(_InTurn):
    """A Sequence that begins again with the child that failed, also after it was halted."""

    may_run = True
    ticking = replace(Sequence.ticking, keeps_place=True, gives_way=True)

    def halt(self) -> None:
        """Halt what runs, and keep the place."""
        Control.halt(self)

    def _leave(self) -> None:
        self.reset_children(self._index)


class _Reactive(Control):
    """Ticks all children from the first in each tick; the first that runs has the others halted."""

    ticking = Ticking(Order.REACTIVE, SUCCESS)
    may_run = False

    @classmethod
    def may_end(cls, given: Given, children: Listed[Ends]) -> Ends:  # noqa: ARG003
        """Go on or not with each, in one tick."""
        goes_on = cls.ticking.goes_on
        last = stops_at(children, goes_on)
        ticked = together(children[: None if last is None else last + 1])
        over = ticked & (ENDS - {goes_on})
        skipped = last is None and all(child & SKIPS for child in children)
        return over | (ticked & {goes_on} if last is None else NO_END) | (SKIPS if skipped else NO_END)

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
            if answer is not self.ticking.goes_on:
                self.reset_children()
                return answer
        self.reset_children()
        return SKIPPED if skipped else self.ticking.goes_on


class ReactiveSequence(_Reactive):
    """A Sequence that asks its first children again in each tick; for conditions before one action."""


class ReactiveFallback(_Reactive):
    """A Fallback that asks its first children again in each tick."""

    ticking = Ticking(Order.REACTIVE, FAILURE)
