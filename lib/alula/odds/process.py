"""A decision process: in each state the choices that no model decides, each with the chances of the next states.

How a graph and figures become one (``quantify``):

- What the software does at once takes no time: while it can do something, nothing else happens. Several things at once are choices.
- Else clocks run: skills that end, faults that come and go. Each stage of a clock takes an exponential time, so the next event is
  that of clock ``i`` with the chance ``rate_i / sum of the rates``, after ``1 / sum of the rates`` seconds at the mean. Nothing more
  is needed: no question that is asked here is about a moment.
- A range is a choice between its corners, in each state anew. The chances of a state's next ones are fractions of functions that are
  linear in each rate and each likelihood, so their extremes are at corners: the bounds are exact for figures that vary from use to
  use. For a figure that is one number all the time, but not known, they hold, and may be wider than need be.
- A rate without a bound is one more choice: it comes now.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from alula.odds.figures import ANY_RATE, NEVER, Clock, Figures, Range, point
from alula.odds.graph import Graph
from alula.odds.system import Kind, Outcome, Step

Clocks = tuple[tuple[str, int], ...]
Key = tuple[int, Clocks, tuple[tuple[str, str], ...]]
"""A situation, the stages of clocks that are past their first one, and each fault that a use of something may bring about yet."""
Chances = Mapping[int, Fraction]
Ways = Sequence[Mapping[Key, Fraction]]
Row = tuple[Mapping[Key, Fraction], Fraction, Mapping[str, Mapping[Key, Fraction]]]
"""A choice, by keys: the chances of the next ones, the mean time, the slopes."""
ONE, ZERO = Fraction(1), Fraction(0)


@dataclass(frozen=True)
class Choice:
    """One of the choices of a state.

    Attributes:
        to: the chance of each next state; they add up to 1.
        mean_s: how long it takes, at the mean.
        slopes: how much the chances change with a figure, by its name, per its unit (1/s, 1); they add up to 0.
    """

    to: Chances
    mean_s: Fraction = ZERO
    slopes: Mapping[str, Chances] = field(default_factory=dict)


@dataclass(frozen=True)
class Process:
    """States, each with its choices; the first one is where it begins, and one that has ended has none.

    ``outcomes`` says how. ``open``: what becomes of these was not looked at.
    """

    choices: tuple[tuple[Choice, ...], ...]
    outcomes: tuple[Outcome | None, ...]
    open: frozenset[int] = frozenset()


def quantify(graph: Graph, figures: Figures) -> Process:
    """Return the decision process of a graph with figures; states that it passes in no time and without a choice are left out."""
    return contracted(_Quantifier(graph, figures).process())


@dataclass(frozen=True)
class _Racer:
    """A clock that runs in a state.

    Attributes:
        rate: of this stage, per second.
        ways: where it leads; a corner of what is possible each.
        figure: the name of the figure that the rate hangs on, ``factor`` times.
        surely: it comes some time, if nothing else does.
    """

    rate: Range
    ways: Ways
    figure: str = ""
    factor: int = 1
    surely: bool = False


class _Quantifier:
    def __init__(self, graph: Graph, figures: Figures) -> None:
        self._graph = graph
        self._figures = figures
        self._numbers: dict[Key, int] = {}
        self._faults = [{step.name: step.target for step in steps if step.kind is Kind.FAULT} for steps in graph.steps]
        names = sorted({name for faults in self._faults for name in faults})
        self._at_use: dict[str, list[str]] = {}
        for name in names:
            for use in figures.fault(name).chances:
                self._at_use.setdefault(use, []).append(name)
        self._timed = [frozenset(map(_clock_of, steps)) if not _at_once(steps) else None for steps in graph.steps]

    def process(self) -> Process:
        """Return it; what a numbered key's choices name is numbered on the way."""
        begins = [self._key(place, (), ()) for place in self._graph.initial]
        choices = [tuple(Choice({1 + self._number(key): ONE}) for key in begins)]
        keys: list[Key] = []
        while len(keys) < len(self._numbers):
            keys += itertools.islice(self._numbers, len(keys), None)
            while len(choices) <= len(keys):
                choices.append(tuple(self._numbered(keys[len(choices) - 1])))
        outcomes = (None, *(self._graph.outcomes[place] for place, _, _ in keys))
        unseen = frozenset(number for number, (place, _, _) in enumerate(keys, start=1) if place == self._graph.open)
        return Process(tuple(choices), outcomes, unseen)

    def _number(self, key: Key) -> int:
        return self._numbers.setdefault(key, len(self._numbers))

    def _key(self, place: int, clocks: Clocks, uses: Sequence[str]) -> Key:
        """Return the key of a situation: clocks that don't run there have begun anew when they run again."""
        running = self._timed[place]
        pending = tuple((fault, use) for use in uses for fault in self._at_use.get(use, ()))
        restarted = {_end_of(use) for use in uses}
        kept = tuple(one for one in clocks if one[0] not in restarted and (running is None or one[0] in running))
        return place, kept, pending

    def _after(self, step: Step[int], clocks: Clocks) -> Key:
        return self._key(step.target, tuple(one for one in clocks if one[0] != _clock_of(step)), step.uses)

    def _numbered(self, key: Key) -> Iterator[Choice]:
        for weights, mean_s, slopes in self._choices(key):
            numbered = {name: {1 + self._number(to): by for to, by in slope.items()} for name, slope in slopes.items()}
            yield Choice({1 + self._number(to): chance for to, chance in weights.items()}, mean_s, numbered)

    def _choices(self, key: Key) -> Iterator[Row]:
        place, clocks, pending = key
        steps = self._graph.steps[place]
        if pending:
            yield from self._of_use(key)
        elif self._graph.outcomes[place] is None and place != self._graph.open:
            now = [step for step in steps if step.kind is Kind.NOW]
            if now:
                yield from ((({self._after(step, clocks): ONE}), ZERO, {}) for step in now)
            else:
                yield from self._of_time(key)

    def _of_use(self, key: Key) -> Iterator[Row]:
        """Yield the choices where a use may bring about a fault."""
        place, clocks, ((fault, use), *rest) = key
        spared: Key = (place, clocks, tuple(rest))
        if fault not in self._faults[place]:
            yield {spared: ONE}, ZERO, {}
            return
        struck: Key = (*self._key(self._faults[place][fault], clocks, ())[:2], tuple(rest))
        for chance in self._figures.fault(fault).chances[use].corners:
            slopes = {} if struck == spared else {f"{fault} at {use}": {struck: ONE, spared: -ONE}}
            yield _merged([(struck, chance), (spared, 1 - chance)]), ZERO, slopes

    # --- time ---------------------------------------------------------------------------------------------------------

    def _of_time(self, key: Key) -> Iterator[Row]:
        """Yield the choices where clocks run."""
        place, clocks, _ = key
        steps = self._graph.steps[place]
        racers = list(self._racers(key))
        yield from (({self._after(step, clocks): ONE}, ZERO, {}) for step in steps if step.kind in {Kind.ANY, Kind.SOON})
        yield from ((way, ZERO, {}) for racer in racers if racer.rate.high is None for way in racer.ways)
        running = [racer for racer in racers if racer.rate != NEVER]
        for rates in itertools.product(*(racer.rate.corners for racer in running)):
            total = sum(rates, ZERO)
            if total:
                timed = [(racer, rate) for racer, rate in zip(running, rates, strict=True) if rate]
                for ways in itertools.product(*(racer.ways for racer, _ in timed)):
                    yield _race(timed, ways, total)
            elif not any(racer.surely for racer in running) and not any(step.kind is Kind.SOON for step in steps):
                yield {key: ONE}, ZERO, {}  # it waits for ever

    def _racers(self, key: Key) -> Iterator[_Racer]:
        place, clocks, _ = key
        skills: dict[str, list[Step[int]]] = {}
        for step in self._graph.steps[place]:
            if step.kind is Kind.FAULT:
                yield self._racer(key, step, self._figures.fault(step.name).clock, step.name)
            elif step.kind is Kind.MENDED:
                yield self._racer(key, step, self._figures.fault(step.name).recovery)
            elif step.kind is Kind.WAIT:
                lasts = point(Fraction(step.seconds)) if step.seconds else self._figures.skill(step.name).progress
                yield _Racer(lasts.inverse(), [{self._after(step, clocks): ONE}], surely=True)
            elif step.kind is Kind.END:
                fails = self._figures.skill(step.name).fails
                if step.result in fails:
                    yield self._racer(key, step, Clock(fails[step.result]), f"{step.name} {step.result}")
                else:
                    skills.setdefault(step.name, []).append(step)
        for name, ends in skills.items():
            figures = self._figures.skill(name)
            likely = figures.likelihoods([step.result for step in ends])
            targets = [self._after(step, clocks) for step in ends]
            ways = [_merged(zip(targets, chances, strict=True)) for chances in likely]
            yield self._staged(key, _end_of(name), figures.clock, ways, surely=True)

    def _racer(self, key: Key, step: Step[int], clock: Clock, figure: str = "") -> _Racer:
        return self._staged(key, _clock_of(step), clock, [{self._after(step, key[1]): ONE}], figure)

    def _staged(self, key: Key, name: str, clock: Clock, ways: Ways, figure: str = "", *, surely: bool = False) -> _Racer:
        place, clocks, _ = key
        stage = dict(clocks).get(name, 0)
        factor = clock.factors[stage]
        if stage + 1 < len(clock.factors):
            ways = [{(place, tuple(sorted({**dict(clocks), name: stage + 1}.items())), ()): ONE}]
        return _Racer(clock.rate.times(factor), ways, figure, factor, surely and clock.rate == ANY_RATE)


def _race(timed: Sequence[tuple[_Racer, Fraction]], ways: Sequence[Mapping[Key, Fraction]], total: Fraction) -> Row:
    to: dict[Key, Fraction] = {}
    for (_, rate), way in zip(timed, ways, strict=True):
        for key, chance in way.items():
            to[key] = to.get(key, ZERO) + chance * rate / total
    slopes = {}
    for (racer, _), way in zip(timed, ways, strict=True):
        if racer.figure:
            keys = {**to, **way}
            slopes[racer.figure] = {key: racer.factor * (way.get(key, ZERO) - to.get(key, ZERO)) / total for key in keys}
    return to, 1 / total, slopes


def _merged(chances: Iterable[tuple[Key, Fraction]]) -> dict[Key, Fraction]:
    """Return the chances of next states: several ways may lead to one of them."""
    found: dict[Key, Fraction] = {}
    for key, chance in chances:
        if chance:
            found[key] = found.get(key, ZERO) + chance
    return found


def _at_once(steps: Sequence[Step[int]]) -> bool:
    return any(step.kind is Kind.NOW for step in steps)


def _end_of(skill: str) -> str:
    return f"end {skill}"


def _clock_of(step: Step[int]) -> str:
    return _end_of(step.name) if step.kind is Kind.END else f"{step.kind.value} {step.name}"


# --- states that it passes in no time -----------------------------------------------------------------------------------


def contracted(process: Process) -> Process:
    """Return the process without the states that have one choice, one next state, and take no time."""
    onward = {number: next(iter(only[0].to)) for number, only in enumerate(process.choices) if _is_passed(number, only)}
    places = {number: _followed(number, onward) for number in range(len(process.choices))}
    order = {places[0]: 0}
    found = list(order)
    for number in found:  # it grows on the way
        for choice in process.choices[number]:
            for to in map(places.__getitem__, choice.to):
                if to not in order:
                    order[to] = len(order)
                    found.append(to)
    kept = tuple(tuple(_renumbered(choice, places, order) for choice in process.choices[number]) for number in found)
    unique = tuple(tuple({_identity(choice): choice for choice in choices}.values()) for choices in kept)
    opened = frozenset(order[number] for number in process.open if number in order)
    return Process(unique, tuple(process.outcomes[number] for number in found), opened)


def _is_passed(number: int, choices: Sequence[Choice]) -> bool:
    return len(choices) == 1 and not choices[0].mean_s and len(choices[0].to) == 1 and number not in choices[0].to


def _followed(number: int, onward: Mapping[int, int]) -> int:
    """Return where a state leads in no time; of a circle, its least state."""
    seen = [number]
    while seen[-1] in onward:
        after = onward[seen[-1]]
        if after in seen:
            return min(seen[seen.index(after) :])
        seen.append(after)
    return seen[-1]


def _renumbered(choice: Choice, places: Mapping[int, int], order: Mapping[int, int]) -> Choice:
    def summed(chances: Chances) -> Chances:
        found: dict[int, Fraction] = {}
        for to, by in chances.items():
            if places[to] in order:
                number = order[places[to]]
                found[number] = found.get(number, ZERO) + by
        return found

    return Choice(summed(choice.to), choice.mean_s, {name: summed(slope) for name, slope in choice.slopes.items()})


def _identity(choice: Choice) -> object:
    return frozenset(choice.to.items()), choice.mean_s, tuple(sorted((name, frozenset(s.items())) for name, s in choice.slopes.items()))
