"""Ticks that repeat: one that reads the same from a mission's memory, and gets the same answers, has the same effect.

Memories of a mission differ mostly in entries of the blackboards that a tick does not look at. So a tick is kept by what it read, entries
and answers one after another, and holds for each memory that is the same there; what it has not looked at stays as it is.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from operator import itemgetter

from alula.prove.mission.memory import Keeper, Looked, TreeMemory, exact
from alula.prove.mission.oracle import Answer, Asked, Question, View
from alula.prove.mission.touched import Place, Touched

Kind = tuple[TreeMemory, tuple[type, ...], str]
"""A memory without what is on its blackboards, the types of its values, and what is done: a tick or an abort."""


@dataclass(frozen=True)
class Effect:
    """The requests of a tick, its observed effects on nodes, and the memory after it, with only those entries that it touched."""

    after: TreeMemory
    looked: Looked | None
    started: tuple[int, ...]
    interrupted: tuple[int, ...]
    nodes: frozenset[tuple[int, str]]
    touched: frozenset[Place] = frozenset()


@dataclass
class _Step:
    """An entry that a tick looks at first, or a question; ``options`` are empty for an observation."""

    entry: Place | None
    question: Question = ()
    options: tuple[Answer, ...] = ()
    next: dict[Hashable, _Step | Effect] = field(default_factory=dict)


class Repeated:
    """The ticks done so far, by what they read."""

    def __init__(self, keeper: Keeper) -> None:
        self._keeper = keeper
        self._known: dict[Kind, _Step | Effect] = {}
        self._first: tuple[TreeMemory | None, str] = (None, "")
        self._kind: Kind | None = None
        self._entries: Mapping[Place, Hashable] = {}

    def find(self, memory: TreeMemory, act: str, view: View, answers: Sequence[Answer]) -> tuple[list[Asked], Effect] | None:
        """Return the questions and the effect of a known tick that reads the same and begins with these answers; None: there is none."""
        found = self._known.get(self._kind_of(memory, act))
        asked: list[Asked] = []
        while isinstance(found, _Step):
            if found.entry is not None:
                found = found.next.get(self._entries.get(found.entry))
                continue
            answer = answers[len(asked)] if len(asked) < len(answers) else _answer(found, view)
            asked.append(Asked(found.question, found.options, answer))
            found = found.next.get(answer)
        return None if found is None else (asked, found)

    def after(self, memory: TreeMemory, effect: Effect) -> TreeMemory:
        """Return the memory after a tick that has this effect, from a memory that agrees in all that the tick reads."""
        if effect.looked is None:
            return effect.after
        boards = []
        for number, (before, written) in enumerate(zip(memory.boards, effect.after.boards, strict=True)):
            left = [self._keeper.kept(number, one, effect.looked) for one in before if (number, one[0]) not in effect.touched]
            boards.append(tuple(sorted([*left, *written], key=itemgetter(0))) if left else written)
        return effect.after._replace(boards=tuple(boards))

    def keep(self, memory: TreeMemory, act: str, asked: Sequence[Asked], effect: Effect, touched: Touched) -> None:
        """Store a tick that was done from a memory."""
        if touched.everything:
            return
        kind = self._kind_of(memory, act)
        steps: list[tuple[_Step, Hashable]] = []
        looked = list(touched.places.items())
        for number, one in enumerate((*asked, None)):
            while looked and looked[0][1] <= number:
                place, _ = looked.pop(0)
                steps.append((_Step(place), self._entries.get(place)))
            if one is not None:
                steps.append((_Step(None, one.question, one.options), one.answer))
        places = frozenset(touched.places)
        boards = tuple(tuple(one for one in board if (number, one[0]) in places) for number, board in enumerate(effect.after.boards))
        last = replace(effect, after=effect.after._replace(boards=boards), touched=places)
        if not steps:
            self._known[kind] = last
            return
        at = self._known.setdefault(kind, steps[0][0])
        for (_, answer), (following, _) in pairwise(steps):
            assert isinstance(at, _Step)  # noqa: S101 - a tick hangs on nothing else
            at = at.next.setdefault(answer, following)
        assert isinstance(at, _Step)  # noqa: S101
        at.next[steps[-1][1]] = last

    def _kind_of(self, memory: TreeMemory, act: str) -> Kind:
        if self._kind is None or self._first[0] is not memory or self._first[1] != act:
            self._first = memory, act
            self._kind = memory._replace(boards=()), tuple(map(type, memory.nodes)), act
            self._entries = {(number, one[0]): exact(one) for number, board in enumerate(memory.boards) for one in board}
        return self._kind


def _answer(step: _Step, view: View) -> Answer:
    """Return the answer to a question that none is given for, as the oracle does."""
    return step.options[0] if step.options else view(step.question)
