"""Which situations at rest surely lead to the mission's end, many at once: one by one there are millions of a mission of two robots.

A group is a memory with one set of managers at rest a skillset, and stands for each choice of them (``Regions``). The mission surely ends
after a group when, whatever its situations answer, a tick can come from each of them to the end or into a group after which it surely
ends. Where one target has to do for all that answer alike, groups can be in doubt although the mission ends after each situation of them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from alula.prove.limits import Deadline
from alula.prove.mission.fitting import Values, agree
from alula.prove.mission.oracle import Answer
from alula.prove.mission.regions import Regions, Sets
from alula.prove.mission.ticking import TICK, Outcome

Come = Callable[[int, int, Outcome], tuple[int, ...]]
"""Of a skillset's place and the number of its managers: managers at rest after what a tick has asked for."""


class Group(NamedTuple):
    """Situations at rest: each choice of ``managers``, sorted by how soon they come; ``region`` has them all."""

    region: int
    memory: int
    managers: tuple[Sequence[int], ...]


class _Way(NamedTuple):
    """What a tick can come to: its outcome with all sets of managers that must meet the target's, or what follows from answers.

    Of observations all that follow count (``parts``), of what nobody knows any one.
    """

    outcome: Outcome | None
    come: tuple[frozenset[tuple[int, ...]], ...]
    parts: tuple[_Way, ...]
    any_part: bool

    def outcomes(self) -> Iterator[Outcome]:
        """Yield all that it can come to."""
        if self.outcome is not None:
            yield self.outcome
        for part in self.parts:
            yield from part.outcomes()


class Ending:
    """Finds the groups of which it is in doubt whether the mission ends after them."""

    def __init__(self, regions: Regions, groups: Iterable[Group], come: Come) -> None:
        self._regions = regions
        self._memories = regions.system.ticker.memories
        self._come = come
        self.groups = list(groups)
        self._sets: list[Sets] = [tuple(map(frozenset, group.managers)) for group in self.groups]
        self._ways: list[_Way] = []
        self._leading: defaultdict[int, list[int]] = defaultdict(list)
        """By memories the numbers of the groups from which a tick can come to them."""

    def doubtful(self, values: Values, deadline: Deadline) -> list[Group]:
        """Return those in doubt while data have these values, in their order; raises OutOfTimeError."""
        self._look_ahead(deadline)
        sure: defaultdict[int, list[Sets]] = defaultdict(list)
        doubtful = set(range(len(self.groups)))
        # What leads to these memories may have become sure: first, what leads to the end.
        todo = dict.fromkeys(memory for memory in self._leading if self._memories[memory].end is not None)
        while todo:
            deadline.check()
            reached = next(iter(todo))
            del todo[reached]
            for number in self._leading[reached]:
                if number in doubtful and self._ends(self._ways[number], sure, values):
                    doubtful.discard(number)
                    memory = self.groups[number].memory
                    sure[memory].append(self._sets[number])
                    todo[memory] = None
        return [self.groups[number] for number in sorted(doubtful)]

    def _look_ahead(self, deadline: Deadline) -> None:
        for number in range(len(self._ways), len(self.groups)):
            deadline.check()
            way = self._following(self.groups[number].memory, (), self._sets[number])
            self._ways.append(way)
            for memory in {outcome.memory for outcome in way.outcomes()}:
                self._leading[memory].append(number)

    def _following(self, memory: int, answers: tuple[Answer, ...], sets: Sets) -> _Way:
        found = self._regions.follow(memory, TICK, answers, sets)
        if isinstance(found, Outcome):
            come = (frozenset(self._come(place, number, found) for number in numbers) for place, numbers in enumerate(sets))
            return _Way(found, tuple(come), (), any_part=False)
        parts = tuple(self._following(memory, (*answers, answer), left) for answer, left in found.ways)
        return _Way(None, (), parts, found.free)

    def _ends(self, way: _Way, sure: Mapping[int, Sequence[Sets]], values: Values) -> bool:
        if way.outcome is None:
            ends = (self._ends(part, sure, values) for part in way.parts)
            return any(ends) if way.any_part else all(ends)
        if not agree(values, way.outcome.choices):
            return False
        if self._memories[way.outcome.memory].end is not None:
            return all(after for several in way.come for after in several)
        return any(
            all(not target.isdisjoint(after) for target, several in zip(sets, way.come, strict=True) for after in several)
            for sets in sure[way.outcome.memory]
        )
