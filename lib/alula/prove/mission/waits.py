"""Situations in which a mission waits for ever, or goes round without end, though the world is calm and every execution ends.

From each situation calm steps come to one at rest: all that was asked for has arrived, and all that ends has ended. So it is enough to look
at situations at rest, from one tick to the next: the mission never ends after one that no such way leads to its end from.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import NamedTuple

from alula.common.graphs import reachable_from
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.calm import calm_of
from alula.prove.mission.ending import Ending, Group
from alula.prove.mission.fitting import Values, agree, all_values, answers
from alula.prove.mission.measured import DATA
from alula.prove.mission.oracle import Answer, Asked, Question
from alula.prove.mission.regions import Closure, Regions
from alula.prove.mission.state import Event, State
from alula.prove.mission.ticking import Outcome
from alula.prove.mission.words import choice
from alula.trees.node import Node


@dataclass(frozen=True)
class _AfterTick:
    """The effect of a tick's outcome: the data that it was given, and the managers of each skillset after it."""

    ticked: Outcome
    about_data: tuple[Asked, ...]
    come: tuple[dict[int, tuple[int, ...]], ...]


class _Resting(NamedTuple):
    """Managers at rest of one skillset, sorted by how soon they come: those that live, and those that have died."""

    alive: tuple[int, ...]
    dead: tuple[int, ...]


class Waits:
    """The situations at rest in which a mission can be, and those after which it never ends."""

    def __init__(self, regions: Regions) -> None:
        self._regions = regions
        self._system = regions.system
        self._calm = calm_of(regions.system, terminating=True)
        self._resting_in: dict[int, _Resting] = {}
        """By the identity of closures."""
        self._at_rest: dict[tuple[int, int], tuple[int, ...]] = {}
        self._after_ticks: dict[int, _AfterTick] = {}
        """By the identity of what a tick comes to, which the ticker keeps: these are asked for of millions of situations."""
        self._answers: dict[Question, tuple[int, dict[int, Answer]]] = {}
        self._before: dict[State, list[State]] = {}
        self._after: dict[State, list[State]] = {}
        self._ends: set[State] = set()
        self._asking: set[State] = set()
        self._open: set[State] = set()
        """Those that were not looked at any further: they may lead anywhere."""
        self.always_ends = False
        """Whether all were looked at, and the mission can come to an end from each: known once ``found`` is through."""

    def found(self, deadline: Deadline) -> Iterator[tuple[Node, list[Event], State, bool, str]]:
        """Yield each node that the mission waits in for ever, a run to there, the situation, whether all stays as it is, and the data.

        When the time is over, it yields those of what was looked at by then, and raises OutOfTimeError.
        """
        told: set[tuple[int, bool]] = set()
        questions = tuple(self._system.ticker.about_data)
        over: OutOfTimeError | None = None
        ends = self._regions.complete
        ending = Ending(self._regions, self._groups(deadline), self._at_rest_after)
        for values in all_values(questions):
            first: dict[State, int] = {}
            self._before, self._after, self._ends, self._open, self._asking = {}, {}, set(), set(), set()
            try:
                self._situations(ending.doubtful(values, deadline), first, deadline)
                self._explore(list(first), deadline, values)
            except OutOfTimeError as error:
                over = error
            good = reachable_from(self._ends | self._open, lambda one: self._before.get(one, ()))
            never = set(self._after) - good
            ends = ends and not never
            data = ", ".join(words for one in answers(values, questions) if (words := choice(one)))
            for found in self._never_over(first, never, told):
                yield (*found, data)
            if over is not None:
                raise over
        self.always_ends = ends

    def _never_over(
        self, first: Mapping[State, int], never: set[State], told: set[tuple[int, bool]]
    ) -> Iterator[tuple[Node, list[Event], State, bool]]:
        """Yield the situations after which the mission never ends, without those in ``told``."""
        known: set[State] = set()
        for begin in (state for state in first if state in never):
            if begin in known:
                continue
            rounds = self._last(begin)
            explained = reachable_from(rounds, lambda one: self._before.get(one, ()))
            known |= explained
            state = next((one for one in first if one in rounds), begin)
            active = [node for node in self._system.active(state) if all(node in self._system.active(one) for one in rounds)]
            stays = len(rounds) == 1 and state not in self._asking
            if active and (id(active[-1]), stays) not in told:
                told.add((id(active[-1]), stays))
                yield active[-1], self._regions.run(first[state], dict(enumerate(state.managers))), state, stays

    def _last(self, state: State) -> set[State]:
        """Return situations that are come to from there, each of which leads to all others of them and to nothing else."""
        while True:
            after = reachable_from([state], lambda one: self._after.get(one, ()))
            before = reachable_from([state], lambda one: self._before.get(one, ()))
            left = after - before
            if not left:
                return after
            state = min(left)

    def _groups(self, deadline: Deadline) -> Iterator[Group]:
        """Yield all situations at rest, with the managers of one skillset dead at most: with those of several there are too many."""
        for number, region in enumerate(self._regions.regions):
            deadline.doing = f"waits: {number} of {len(self._regions.regions)} regions at rest"
            deadline.check()
            if not self._system.ticker.memories[region.memory].started or self._over(region.memory):
                continue
            resting = [self._resting_of(place, closure) for place, closure in enumerate(region.closures)]
            for choices in _one_dead(resting):
                yield Group(number, region.memory, choices)

    def _resting_of(self, place: int, closure: Closure) -> _Resting:
        """Return the managers at rest of those that can come of others; the regions keep the closures, which are few."""
        known = self._resting_in.get(id(closure))
        if known is None:
            rests = sorted((one for one in closure.all if self._rests(place, one)), key=closure.depth.__getitem__)
            living = [self._system.managers_of(one).states is not None for one in rests]
            alive = tuple(one for one, lives in zip(rests, living, strict=True) if lives)
            dead = tuple(one for one, lives in zip(rests, living, strict=True) if not lives)
            known = self._resting_in[id(closure)] = _Resting(alive, dead)
        return known

    def _situations(self, groups: Iterable[Group], found: dict[State, int], deadline: Deadline) -> None:
        """Add those of groups, each with the first region that has it."""
        for group in groups:
            deadline.check()
            for managers in product(*group.managers):
                if (group.memory, managers) not in found:
                    found[State(group.memory, managers)] = group.region
                    deadline.check()

    def _explore(self, todo: list[State], deadline: Deadline, values: Values) -> None:
        """Look at what comes after situations while data have these values."""
        seen, waiting = set(todo), deque(todo)
        self._open = seen.copy()
        while waiting:
            deadline.doing = f"waits: {len(waiting)} situations to look at"
            deadline.check()
            state = waiting.popleft()
            come = list(self._next(state, values))
            if come:
                self._after[state] = come
            for after in come:
                self._before.setdefault(after, []).append(state)
                if self._over(after.memory):
                    self._ends.add(after)
                elif after not in seen:
                    seen.add(after)
                    self._open.add(after)
                    waiting.append(after)
            self._open.discard(state)

    def _next(self, state: State, values: Values) -> Iterator[State]:
        """Yield the situations at rest after a tick."""
        for ticked in self._system.ticker.outcomes(state.memory, partial(self._answer, state.managers)):
            known = self._after_ticks.get(id(ticked)) or self._after_tick(ticked)
            if known.about_data and not agree(values, known.about_data):
                continue
            if ticked.started:
                self._asking.add(state)
            after = [
                come.get(one) or self._come(place, one, known)
                for place, (one, come) in enumerate(zip(state.managers, known.come, strict=True))
            ]
            for managers in product(*after):
                yield State(ticked.memory, managers)

    def _answer(self, managers: tuple[int, ...], question: Question) -> Answer:
        """Answer an observation by what the managers that it is of have answered before."""
        known = self._answers.get(question)
        if known is None:
            known = self._answers[question] = (self._system.place_of(question), {})
        place, answers = known
        number = managers[place]
        if number not in answers:
            answers[number] = self._system.answer(number, question)
        return answers[number]

    def _after_tick(self, ticked: Outcome) -> _AfterTick:
        about_data = tuple(one for one in ticked.choices if one.question[0] == DATA)
        return self._after_ticks.setdefault(id(ticked), _AfterTick(ticked, about_data, tuple({} for _ in self._system.skillsets)))

    def _come(self, place: int, number: int, known: _AfterTick) -> tuple[int, ...]:
        come = known.come[place][number] = self._at_rest_after(place, number, known.ticked)
        return come

    def _at_rest_after(self, place: int, number: int, ticked: Outcome) -> tuple[int, ...]:
        """Return managers at rest after what a tick has asked for."""
        return self._resting(place, self._regions.after(place, number, ticked))

    def _over(self, memory: int) -> bool:
        return self._system.ticker.memories[memory].end is not None

    def _rests(self, place: int, number: int) -> bool:
        return not any(self._calm(event) for event, _ in self._system.moves_of(place, number))

    def _resting(self, place: int, number: int) -> tuple[int, ...]:
        """Return managers at rest that calm steps lead to."""
        key = (place, number)
        if key not in self._at_rest:
            moves = self._system.moves_of
            seen = reachable_from([number], lambda one: (after for event, after in moves(place, one) if self._calm(event)))
            self._at_rest[key] = tuple(one for one in sorted(seen) if self._rests(place, one))
        return self._at_rest[key]


def _one_dead(resting: Sequence[_Resting]) -> Iterator[tuple[tuple[int, ...], ...]]:
    """Yield the managers that live, and with those of one skillset dead."""
    alive = tuple(one.alive for one in resting)
    yield alive
    for place, one in enumerate(resting):
        if one.dead:
            yield (*alive[:place], one.dead, *alive[place + 1 :])
