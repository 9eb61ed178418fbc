"""The situations that a system can come into, the likeliest first, numbered, with the steps between them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from typing import Generic, TypeVar

from alula.odds.figures import ANY_CHANCE, ANY_RATE, Figures, Range
from alula.odds.system import Kind, LabelledSystem, Outcome, Step

State = TypeVar("State", bound=Hashable)
OnProgress = Callable[[int, int], None]
"""Gets how many situations were found, and how many of them were looked at."""
TELL_EVERY = 10_000
MOST_SITUATIONS = 1_000_000


@dataclass(frozen=True)
class Graph:
    """The explored part of a system, its situations numbered.

    Attributes:
        initial: where it can begin.
        steps: from each situation, by its number; what changes nothing is no step.
        outcomes: of each situation.
        open: the number of the one that stands for all that was found but not looked at; None: there is none.
        left: how many situations these are.
    """

    initial: tuple[int, ...]
    steps: tuple[tuple[Step[int], ...], ...]
    outcomes: tuple[Outcome | None, ...]
    open: int | None = None
    left: int = 0


def explore(
    system: LabelledSystem[State],
    figures: Figures = Figures(),  # noqa: B008 - a value
    *,
    most: int = MOST_SITUATIONS,
    unlikely: float = 0.0,
    on_progress: OnProgress | None = None,
) -> Graph:
    """Explore the situations that a system can come into, the likeliest first.

    Ctrl-C ends it as ``most`` does.

    Args:
        system: what is looked at.
        figures: say how likely each way to a situation is at most. While the software is at work, only faults that come at a use of
            something happen besides.
        most: of the situations that are looked at.
        unlikely: what each single way leads to with a smaller chance is not looked at.
        on_progress: how far it is, every so often.
    """
    search = _Search(system, figures)
    with suppress(KeyboardInterrupt):  # what was found until then holds
        search.run(most, unlikely, on_progress)
    return search.graph()


class _Search(Generic[State]):
    def __init__(self, system: LabelledSystem[State], figures: Figures) -> None:
        self._system = system
        self._figures = figures
        self._numbers: dict[State, int] = {}
        for state in system.initial():
            self._numbers.setdefault(state, len(self._numbers))
        self._initial = tuple(self._numbers.values())
        self._states = list(self._numbers)
        self._chance = dict.fromkeys(self._initial, 1.0)
        self._looked: dict[int, tuple[Outcome | None, tuple[Step[int], ...]]] = {}

    def run(self, most: int, unlikely: float, on_progress: OnProgress | None) -> None:
        """Explore the situations; one to which a likelier path is found than the first keeps its number."""
        todo = [(-1.0, number) for number in self._initial]
        while todo and len(self._looked) < most:
            chance, number = heappop(todo)
            if number in self._looked or -chance < unlikely:
                continue
            outcome, steps = self._look(number)
            for step, part in zip(steps, likelihoods(steps, self._figures), strict=True):
                if -chance * part > self._chance.get(step.target, -1.0):
                    self._chance[step.target] = -chance * part
                    heappush(todo, (chance * part, step.target))
            self._looked[number] = outcome, steps
            if on_progress is not None and len(self._looked) % TELL_EVERY == 0:
                on_progress(len(self._states), len(self._looked))

    def graph(self) -> Graph:
        """Return what was found; all that was not looked at is one situation, the last."""
        places = {number: place for place, number in enumerate(sorted(self._looked))}
        known = [self._looked[number] for number in places]
        left, unseen = len(self._states) - len(places), len(places)
        steps = [tuple(dict.fromkeys(replace(step, target=places.get(step.target, unseen)) for step in one)) for _, one in known]
        outcomes = [outcome for outcome, _ in known]
        initial = tuple(places.get(number, unseen) for number in self._initial)
        if not left:
            return Graph(initial, tuple(steps), tuple(outcomes))
        return Graph(initial, (*steps, ()), (*outcomes, None), unseen, left)

    def _look(self, number: int) -> tuple[Outcome | None, tuple[Step[int], ...]]:
        state = self._states[number]
        outcome = self._system.outcome(state)
        found = [] if outcome is not None else [step for step in self._system.steps(state) if _moves(step, state)]
        if any(step.kind is Kind.NOW for step in found):
            found = [step for step in found if step.kind is Kind.NOW or (step.kind is Kind.FAULT and step.name in self._figures.at_use)]
        for step in found:
            if step.target not in self._numbers:
                self._numbers[step.target] = len(self._states)
                self._states.append(step.target)
        return outcome, tuple(dict.fromkeys(_numbered(step, self._numbers) for step in found))


def without_figures(graph: Graph, figures: Figures) -> list[str]:
    """Return the names of the faults, transitions and skills in a graph that have no figures, sorted.

    Of a skill these are the chances of its results: one result without a chance takes what the others leave, two share it anyhow.
    """
    lacking: set[str] = set()
    open_ends: dict[str, set[str]] = {}
    for step in (step for steps in graph.steps for step in steps):
        if step.kind is Kind.FAULT:
            of_fault = figures.fault(step.name)
            lacking |= {step.name} if of_fault.rate == ANY_RATE and not of_fault.chances else set()
        elif step.kind is Kind.END:
            of_skill = figures.skill(step.name)
            lacking |= set() if step.name in figures.skills else {step.name}
            open_ends.setdefault(step.name, set()).update({step.result} - {*of_skill.results, *of_skill.fails})
    return sorted(lacking | {skill for skill, ends in open_ends.items() if len(ends) > 1})


def likelihoods(steps: Sequence[Step[int]], figures: Figures) -> list[float]:
    """Return the greatest probability of each step out of a situation; 1 where there is no figure."""
    rates = [_rate(step, figures) for step in steps]
    sure = sum(rate or 0.0 for step, rate in zip(steps, rates, strict=True) if step.kind in {Kind.END, Kind.WAIT})
    return [1.0 if rate is None or not sure else min(1.0, rate / sure) for rate in rates]


def _rate(step: Step[int], figures: Figures) -> float | None:
    """Return the greatest rate with which a step is taken, per second; None: there is no figure."""
    match step.kind:
        case Kind.FAULT:
            found = figures.fault(step.name)
            return None if found.chances else _high(found.rate)
        case Kind.MENDED:
            return None
        case Kind.WAIT:
            return 1 / step.seconds if step.seconds else None
        case Kind.END:
            skill = figures.skill(step.name)
            if step.result in skill.fails:
                return _high(skill.fails[step.result])
            chance, rate = skill.results.get(step.result, ANY_CHANCE).high, _high(skill.lasts.inverse())
            return None if rate is None or chance is None else rate * float(chance)
    return None


def _high(rate: Range) -> float | None:
    return None if rate.high is None else float(rate.high)


def _numbered(step: Step[State], numbers: Mapping[State, int]) -> Step[int]:
    return Step(step.kind, step.name, numbers[step.target], step.result, step.uses, step.seconds)


def _moves(step: Step[State], state: State) -> bool:
    return step.kind not in {Kind.NOW, Kind.SOON, Kind.ANY} or step.target != state
