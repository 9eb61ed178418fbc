"""All runs of a mission, many at once.

Between two ticks the managers of different skillsets have nothing to do with one another: what can have come of each is a set, and a
situation before the next tick is any choice of one of each set. A tick tells managers apart by what it observes, which divides these sets
and leaves a product again. So a region, a memory of the tree with one set a skillset, stands for all its situations exactly.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from operator import is_not

from alula.common.graphs import ShortestWays
from alula.prove.limits import Deadline
from alula.prove.mission.oracle import Answer, Question
from alula.prove.mission.state import Event, Kind, State
from alula.prove.mission.system import System
from alula.prove.mission.ticking import ABORT, TICK, Decision, Outcome

Sets = tuple[frozenset[int], ...]
"""For each skillset the numbers of managers."""
KINDS = {TICK: Kind.TICK, ABORT: Kind.ABORT}


@dataclass(frozen=True)
class Closure:
    """The managers that are reachable from others; ``before`` has for each its predecessor and the event, None for where it began."""

    before: Mapping[int, tuple[int, Event] | None]
    depth: Mapping[int, int]

    @cached_property
    def all(self) -> frozenset[int]:
        """All managers, by their numbers."""
        return frozenset(self.before)

    @cached_property
    def roots(self) -> frozenset[int]:
        """The managers where it begins."""
        return frozenset(number for number, step in self.before.items() if step is None)

    def way(self, number: int) -> tuple[int, list[Event]]:
        """Return the start of a shortest way to managers, and its events."""
        events: list[Event] = []
        while (step := self.before[number]) is not None:
            number, event = step
            events.append(event)
        return number, events[::-1]


@dataclass(frozen=True)
class Ticked:
    """A tick, or an abort, out of a region: the ways in which it comes to one memory and asks for the same.

    ``sets`` are the managers with which it does; each of ``ways`` says what it can be chosen for, and with which of them.
    """

    act: str
    ways: tuple[tuple[Outcome, Sets], ...]
    sets: Sets

    @property
    def outcome(self) -> Outcome:
        """The outcome, the same for all ways but for the choices and the answers of nodes."""
        return self.ways[0][0]

    def way(self, managers: Sequence[int]) -> Outcome:
        """Return the outcome of the way that these managers take."""
        return next(one for one, sets in self.ways if all(number in known for number, known in zip(managers, sets, strict=True)))


@dataclass(frozen=True)
class Fork:
    """A question in a tick: each answer with the managers that give it. ``free``: nobody knows, and any may give each."""

    ways: tuple[tuple[Answer, Sets], ...]
    free: bool
    in_breadth: bool = False


@dataclass
class Region:
    """A memory with all managers that are possible with it.

    ``origins``: the managers that ticks led to, one set a skillset, each with the region before and the tick; None for the first.
    """

    memory: int
    closures: tuple[Closure, ...]
    origins: list[tuple[Sets, tuple[int, Ticked] | None]]
    sets: Sets
    depth: int = 0
    """How many ticks led here at least."""
    next: list[tuple[int, Ticked]] = field(default_factory=list)
    """Each tick that leads to a region, or into one."""

    @property
    def origin(self) -> tuple[int, Ticked] | None:
        """The first of its origins."""
        return self.origins[0][1]

    def origin_of(self, roots: Sequence[int]) -> tuple[int, Ticked] | None:
        """Return the first origin that led to these managers."""
        return next(origin for sets, origin in self.origins if all(one in known for one, known in zip(roots, sets, strict=True)))


LOOK_AT_CLOCK = 512
"""After how many situations of one skillset the time is looked at again: with many free resources one region has millions."""


class Regions:
    """The reachable regions; ``complete`` when all were found."""

    def __init__(self, system: System, deadline: Deadline) -> None:
        self.system = system
        self.regions: list[Region] = []
        self.complete = False
        self.situations = 0
        """How many situations the regions stand for; those of one memory may overlap."""
        self.deadline = deadline
        self._merged: dict[int, int] = {}
        """By their numbers regions that others stand for now."""
        self._by_memory: dict[int, list[int]] = {}
        self._closures: dict[tuple[int, frozenset[int], tuple[bool, bool]], Closure] = {}
        self._answers: dict[tuple[frozenset[int], Question], tuple[tuple[Answer, frozenset[int]], ...]] = {}
        self._commanded: dict[tuple[int, int, int, tuple[int, ...], tuple[int, ...]], int] = {}
        self._followed: dict[tuple[int, frozenset[int], int, tuple[int, ...], tuple[int, ...]], frozenset[int]] = {}
        self._same: dict[frozenset[int], frozenset[int]] = {}

    def explore(self, begin: State | None = None, until: Callable[[Region], bool] = lambda _: False) -> None:
        """Find all regions from a situation on (default: power-up), or up to one region; raises OutOfTimeError.

        Those that few ticks lead to come first; the last is the one that was looked for.
        """
        self.system.ticker.deadline = self.deadline if any(one.why_not for one in self.system.own.taken) else None
        try:
            self.complete = self._explore(begin or self.system.initial(), until)
        finally:
            self._forget_merged()

    def _explore(self, first: State, until: Callable[[Region], bool]) -> bool:
        """Return whether all were found."""
        todo = dict.fromkeys([self._add(first.memory, tuple(frozenset({one}) for one in first.managers), None)])
        while todo:
            number = next(iter(todo))
            del todo[number]
            self.deadline.doing = self._progress(number, len(todo))
            self.deadline.check()
            self._merge(number, todo)
            region = self.regions[number]
            for act in self._acts(region):
                for ticked in self.ticks(region.memory, act, region.sets):
                    memory = ticked.outcome.memory
                    after = self._after(ticked)
                    if memory == region.memory and all(a <= b for a, b in zip(after, region.sets, strict=True)):
                        continue
                    known = self._within(memory, after)
                    if known is None:
                        known = self._add(memory, after, (number, ticked))
                        todo[known] = None
                        if until(self.regions[known]):
                            return False
                    region.next.append((known, ticked))
        return True

    def _progress(self, number: int, left: int) -> str:
        """Return how far the search is, in words."""
        known = len(self.regions)
        return (
            f"{self.situations:,} situations in {known} groups, {left} of them to look at, {self.regions[number].depth} ticks deep,"
            f" {self.deadline.a_second(known):.3g} groups a second"
        )

    def _acts(self, region: Region) -> Iterator[str]:
        if self.system.ticker.memories[region.memory].end is None:
            yield TICK
            if self.system.failures.aborts and self.system.may_abort(region.memory):
                yield ABORT

    # --- ticks -------------------------------------------------------------------------------------------------------

    def ticks(self, memory: int, act: str, sets: Sets) -> Iterator[Ticked]:
        """Yield the results of a tick; ways that differ only in their observations of one skillset are one."""
        found: dict[tuple[int, tuple[int, ...], tuple[int, ...]], list[Ticked]] = {}
        for outcome, left in self.split(memory, act, sets):
            same = found.setdefault((outcome.memory, outcome.started, outcome.interrupted), [])
            one = Ticked(act, ((outcome, left),), left)
            while (other := next((known for known in same if _differ(known.sets, one.sets) <= 1), None)) is not None:
                same.remove(other)
                both = tuple(a if a is b else self.same(a | b) for a, b in zip(other.sets, one.sets, strict=True))
                one = Ticked(act, (*other.ways, *one.ways), both)
            same.append(one)
        for same in found.values():
            yield from same

    def same(self, numbers: frozenset[int]) -> frozenset[int]:
        """Return the one shared instance of this set of numbers: few differ, and they are held many times."""
        return self._same.setdefault(numbers, numbers)

    def split(self, memory: int, act: str, sets: Sets) -> Iterator[tuple[Outcome, Sets]]:
        """Yield each way in which a tick can go, with the managers with which it can."""
        todo: deque[tuple[tuple[Answer, ...], Sets]] = deque([((), sets)])
        while todo:
            answers, left = todo.pop()
            found = self.follow(memory, act, answers, left)
            if isinstance(found, Outcome):
                yield found, left
            else:
                later = [((*answers, answer), divided) for answer, divided in found.ways]
                todo.extendleft(later) if found.in_breadth else todo.extend(later)

    def follow(self, memory: int, act: str, answers: Sequence[Answer], sets: Sets) -> Outcome | Fork:
        """Return the outcome of a tick after its first answers, or its next question, for the managers that give these answers."""
        known = self.system.ticker.known(memory, act, self._view(sets), answers)
        if isinstance(known, Outcome):
            return known
        if known.options:
            return Fork(tuple((option, sets) for option in known.options), free=True, in_breadth=known.in_breadth)
        return Fork(tuple(self._divided(known, sets)), free=False)

    def _divided(self, known: Decision, sets: Sets) -> Iterator[tuple[Answer, Sets]]:
        place = self.system.place_of(known.question)
        key = (sets[place], known.question)
        if key not in self._answers:
            found: dict[Answer, list[int]] = {}
            for number in sets[place]:
                found.setdefault(self.system.answer(number, known.question), []).append(number)
            self._answers[key] = tuple((answer, self.same(frozenset(numbers))) for answer, numbers in found.items())
        for answer, numbers in self._answers[key]:
            yield answer, (*sets[:place], numbers, *sets[place + 1 :])

    def _view(self, sets: Sets) -> _Any:
        return _Any(self.system, sets)

    def after(self, place: int, number: int, outcome: Outcome) -> int:
        """Return the managers after the requests of a tick."""
        key = (place, number, outcome.memory, outcome.started, outcome.interrupted)
        if key not in self._commanded:
            self._commanded[key] = self.system.commanded(place, number, outcome)
        return self._commanded[key]

    def _after(self, ticked: Ticked) -> Sets:
        return tuple(self._all_after(place, numbers, ticked.outcome) for place, numbers in enumerate(ticked.sets))

    def _all_after(self, place: int, numbers: frozenset[int], outcome: Outcome) -> frozenset[int]:
        key = (place, numbers, outcome.memory, outcome.started, outcome.interrupted)
        if key not in self._followed:
            self._followed[key] = self.same(frozenset(self.after(place, number, outcome) for number in numbers))
        return self._followed[key]

    # --- regions -----------------------------------------------------------------------------------------------------

    def _within(self, memory: int, roots: Sets) -> int | None:
        for number in self._by_memory.get(memory, ()):
            if all(a <= b for a, b in zip(roots, self.regions[number].sets, strict=True)):
                return number
        return None

    def _add(self, memory: int, roots: Sets, origin: tuple[int, Ticked] | None) -> int:
        closures = tuple(self.closure(place, numbers, memory) for place, numbers in enumerate(roots))
        sets = tuple(self.same(one.all) for one in closures)
        self.situations += math.prod(map(len, sets))
        depth = 0 if origin is None else self.regions[origin[0]].depth + 1
        self.regions.append(Region(memory, closures, [(roots, origin)], sets, depth))
        self._by_memory.setdefault(memory, []).append(len(self.regions) - 1)
        return len(self.regions) - 1

    def _merge(self, number: int, todo: dict[int, None]) -> None:
        """Have a region that is to be looked at stand for others of its memory, too, that begin otherwise in one skillset only.

        All choices of what both began with are choices of one of them, so the union is exact.
        """
        region = self.regions[number]
        while (other := self._mergeable(number, todo)) is not None:
            del todo[other]
            self._by_memory[region.memory].remove(other)
            self._merged[other] = number
            gone = self.regions[other]
            roots = [a.roots | b.roots for a, b in zip(region.closures, gone.closures, strict=True)]
            region.closures = tuple(self.closure(place, numbers, region.memory) for place, numbers in enumerate(roots))
            region.sets = tuple(self.same(one.all) for one in region.closures)
            region.origins += gone.origins
            region.depth = min(region.depth, gone.depth)

    def _mergeable(self, number: int, todo: Collection[int]) -> int | None:
        mine = self.regions[number].closures
        for one in self._by_memory[self.regions[number].memory]:
            if one in todo and sum(a is not b for a, b in zip(mine, self.regions[one].closures, strict=True)) <= 1:
                return one
        return None

    def _forget_merged(self) -> None:
        """Number the regions anew, without those that others stand for."""
        numbers = {old: new for new, old in enumerate(one for one in range(len(self.regions)) if one not in self._merged)}

        def number(old: int) -> int:
            return numbers[self._merged.get(old, old)]

        self.regions = [one for old, one in enumerate(self.regions) if old in numbers]
        for region in self.regions:
            region.next = [(number(target), ticked) for target, ticked in region.next]
            region.origins = [(sets, origin and (number(origin[0]), origin[1])) for sets, origin in region.origins]
        self._merged.clear()
        self._by_memory.clear()

    def closure(self, place: int, roots: frozenset[int], memory: int) -> Closure:
        """Return the managers that are reachable before the next tick of a mission with this memory."""
        key = (place, roots, self.system.bars(memory))
        if key not in self._closures:
            before: dict[int, tuple[int, Event] | None] = dict.fromkeys(sorted(roots))
            depth = dict.fromkeys(before, 0)
            todo = deque(before)
            looked_at = 0
            while todo:
                number = todo.popleft()
                looked_at += 1
                if looked_at % LOOK_AT_CLOCK == 0:
                    self.deadline.check()
                for event, after in self.system.moves_of(place, number):
                    if after not in before and not self.system.leaves_out(event, memory):
                        before[after], depth[after] = (number, event), depth[number] + 1
                        todo.append(after)
            self._closures[key] = Closure(before, depth)
        return self._closures[key]

    # --- runs --------------------------------------------------------------------------------------------------------

    def run(self, number: int, managers: Mapping[int, int]) -> list[Event]:
        """Return a run to a region in which some skillsets' managers (by their places) are these."""
        region = self.regions[number]
        goal = [managers.get(place, min(one.all, key=one.depth.__getitem__)) for place, one in enumerate(region.closures)]
        events: list[Event] = []
        while True:
            ways = [one.way(target) for one, target in zip(region.closures, goal, strict=True)]
            events = [event for _, way in ways for event in way] + events
            origin = region.origin_of([root for root, _ in ways])
            if origin is None:
                return events
            number, ticked = origin
            region = self.regions[number]
            goal = [self._before(ticked, region, place, root) for place, (root, _) in enumerate(ways)]
            outcome = ticked.way(goal)
            started, interrupted, choices, touched = outcome[1:]
            tick = Event(KINDS[ticked.act], started=started, interrupted=interrupted, choices=choices, touched=touched)
            events.insert(0, tick)

    def soonest(self, number: int, sets: Sets) -> tuple[int, ...]:
        """Return the managers of these sets that a run to a region reaches in the fewest steps."""
        closures = self.regions[number].closures
        return tuple(min(known, key=one.depth.__getitem__) for known, one in zip(sets, closures, strict=True))

    def run_on(self, number: int, outcome: Outcome, sets: Sets, most: int = 20_000) -> tuple[list[Event], State]:
        """Return a run to a region, through a tick with some managers of these sets and on to an end, and the situation at its end.

        It ends after the tick where none of the next ``most`` situations is an end.
        """
        system = self.system
        goal = self.soonest(number, sets)
        events = self.run(number, dict(enumerate(goal)))
        started, interrupted, choices, touched = outcome[1:]
        events.append(Event(Kind.TICK, started=started, interrupted=interrupted, choices=choices, touched=touched))
        first = State(outcome.memory, tuple(self.after(place, one, outcome) for place, one in enumerate(goal)))
        ways = ShortestWays([first], lambda state: (one for one in system.steps(state) if one[0].kind is not Kind.ABORT))
        end = next((state for state in islice(ways, most) if system.outcome(state) is not None), first)
        return events + ways.to(end), end

    def _before(self, ticked: Ticked, region: Region, place: int, root: int) -> int:
        """Return managers, the soonest there are, that a tick takes to these."""
        depth = region.closures[place].depth
        return min((one for one in ticked.sets[place] if self.after(place, one, ticked.outcome) == root), key=depth.__getitem__)


def _differ(one: Sets, other: Sets) -> int:
    """Return in how many places sets differ; equal ones are the same object (`Regions.same`)."""
    return sum(map(is_not, one, other))


class _Any:
    """Answers observations by some managers of each set: those that were asked before answer alike."""

    def __init__(self, system: System, sets: Sets) -> None:
        self._system = system
        self._some = tuple(min(numbers) for numbers in sets)

    def __call__(self, question: Question) -> Answer:
        return self._system.answer(self._some[self._system.place_of(question)], question)
