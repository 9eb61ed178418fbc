"""Situations at rest that surely lead to the mission's end, computed in groups: a mission of two robots has millions of single ones.

A group is a memory with one set of managers at rest a skillset, and stands for each choice of them (``Regions``). The mission surely ends
after a group when, whatever its situations answer, a tick can come from each of them to the end or into a group after which it surely
ends. Where one target has to do for all that answer alike, groups can be in doubt although the mission ends after each situation of them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from alula.prove.limits import Deadline
from alula.prove.mission.fitting import Values, agree
from alula.prove.mission.oracle import Answer
from alula.prove.mission.regions import Regions, Sets
from alula.prove.mission.ticking import TICK, Outcome

Come = Callable[[int, int, Outcome], tuple[int, ...]]
"""Of a skillset's place and the number of its managers: managers at rest after what a tick has asked for."""


class Group(NamedTuple):
    """Situations at rest: each choice of ``managers``, sorted by how soon they come; ``region`` is the first that has them all."""

    region: int
    memory: int
    managers: tuple[Sequence[int], ...]


class _Way(NamedTuple):
    """The results that a tick can have: an outcome, or a question with what follows each answer.

    Of observations all that follow count (``parts``), of what nobody knows any one. Into a target come the managers that each skillset's
    ``must`` holds, and of each of ``either`` one.
    """

    outcome: Outcome | None = None
    must: Sets = ()
    either: tuple[frozenset[tuple[int, ...]], ...] = ()
    parts: tuple[_Way, ...] = ()
    any_part: bool = False

    def outcomes(self) -> Iterator[Outcome]:
        """Yield all that it can come to."""
        if self.outcome is not None:
            yield self.outcome
        for part in self.parts:
            yield from part.outcomes()

    def leads_into(self, sets: Sets) -> bool:
        """Return whether all managers can come into a target."""
        return all(must <= target for must, target in zip(self.must, sets, strict=True)) and not any(
            target.isdisjoint(one) for several, target in zip(self.either, sets, strict=True) for one in several
        )


class Ending:
    """Finds the groups after which the mission may not end."""

    def __init__(self, regions: Regions, groups: Iterable[Group], come: Come) -> None:
        self._regions = regions
        self._memories = regions.system.ticker.memories
        self._come = come
        self.groups: list[Group] = []
        self._sets: list[Sets] = []
        self._keep(groups)
        self._ways: list[_Way] = []
        self._coming: dict[tuple[int, int, frozenset[int]], tuple[frozenset[int], frozenset[tuple[int, ...]]]] = {}
        """By a skillset's place, the identity of an outcome and managers before it, what of each of them has to be in a target."""
        self._leading: defaultdict[int, list[int]] = defaultdict(list)
        """By memories the numbers of the groups from which a tick can come to them."""
        self._sure: defaultdict[int, list[Sets]] = defaultdict(list)
        self._tried: dict[int, int | None] = {}
        """By the identity of ways how many of the groups that are sure were tried as targets; None: one is."""

    def _keep(self, groups: Iterable[Group]) -> None:
        """Keep each group once: regions that differ in what is not at rest have the same ones."""
        known: set[tuple[int, Sets]] = set()
        for group in groups:
            sets = tuple(self._regions.same(frozenset(one)) for one in group.managers)
            if (group.memory, sets) not in known:
                known.add((group.memory, sets))
                self.groups.append(group)
                self._sets.append(sets)

    def doubtful(self, values: Values, deadline: Deadline) -> list[Group]:
        """Return the groups in doubt while data have these values, in their order; raises OutOfTimeError."""
        self._look_ahead(deadline)
        self._sure = defaultdict(list)
        self._tried = {}
        doubtful = set(range(len(self.groups)))
        # What leads to these memories may have become sure: first, what leads to the end.
        todo = dict.fromkeys(memory for memory in self._leading if self._memories[memory].end is not None)
        while todo:
            deadline.doing = f"waits: {len(doubtful)} groups to look at"
            deadline.check()
            reached = next(iter(todo))
            del todo[reached]
            for number in self._leading[reached]:
                if number in doubtful and self._ends(self._ways[number], values):
                    doubtful.discard(number)
                    memory = self.groups[number].memory
                    self._sure[memory].append(self._sets[number])
                    todo[memory] = None
        return [self.groups[number] for number in sorted(doubtful)]

    def _look_ahead(self, deadline: Deadline) -> None:
        for number in range(len(self._ways), len(self.groups)):
            deadline.doing = f"waits: what follows after {number} of {len(self.groups)} groups"
            deadline.check()
            way = self._following(self.groups[number].memory, (), self._sets[number])
            self._ways.append(way)
            for memory in {outcome.memory for outcome in way.outcomes()}:
                self._leading[memory].append(number)

    def _following(self, memory: int, answers: tuple[Answer, ...], sets: Sets) -> _Way:
        found = self._regions.follow(memory, TICK, answers, sets)
        if isinstance(found, Outcome):
            several = [self._coming_of(place, numbers, found) for place, numbers in enumerate(sets)]
            return _Way(found, tuple(must for must, _ in several), tuple(either for _, either in several))
        parts = tuple(self._following(memory, (*answers, answer), left) for answer, left in found.ways)
        return _Way(parts=parts, any_part=found.free)

    def _coming_of(self, place: int, numbers: frozenset[int], outcome: Outcome) -> tuple[frozenset[int], frozenset[tuple[int, ...]]]:
        """Return the managers of a skillset that come surely, and the choices of which one comes; the ticker keeps outcomes."""
        key = (place, id(outcome), numbers)
        if key not in self._coming:
            come = {self._come(place, number, outcome) for number in numbers}
            must = self._regions.same(frozenset(one[0] for one in come if len(one) == 1))
            self._coming[key] = must, frozenset(one for one in come if len(one) != 1)
        return self._coming[key]

    def _ends(self, way: _Way, values: Values) -> bool:
        if way.outcome is None:
            ends = (self._ends(part, values) for part in way.parts)
            return any(ends) if way.any_part else all(ends)
        if not agree(values, way.outcome.choices):
            return False
        if self._memories[way.outcome.memory].end is not None:
            return all(one for several in way.either for one in several)
        tried, sure = self._tried.get(id(way), 0), self._sure[way.outcome.memory]
        if tried is None or any(way.leads_into(sets) for sets in sure[tried:]):
            self._tried[id(way)] = None
            return True
        self._tried[id(way)] = len(sure)
        return False
