"""All situations that a system can come into, numbered, with the steps between them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from alula.odds.system import Kind, LabelledSystem, Outcome, Step

State = TypeVar("State", bound=Hashable)
Tell = Callable[[int, int], None]
"""Gets how many situations were found, and how many of them were looked at."""
TELL_EVERY = 10_000
MOST_SITUATIONS = 1_000_000


@dataclass(frozen=True)
class Graph:
    """A system that was looked at.

    Attributes:
        initial: where it can begin.
        steps: from each situation, by its number; what changes nothing is no step.
        outcomes: of each situation.
        open: situations that were found but not looked at, because there were too many.
    """

    initial: tuple[int, ...]
    steps: tuple[tuple[Step[int], ...], ...]
    outcomes: tuple[Outcome | None, ...]
    open: frozenset[int] = frozenset()


def explore(system: LabelledSystem[State], *, at_use: Collection[str] = (), most: int = MOST_SITUATIONS, tell: Tell | None = None) -> Graph:
    """Look at the situations that a system can come into, the nearest first.

    Args:
        system: what is looked at.
        at_use: faults that come at a use of something, so also while the software is at work; nothing else happens then.
        most: of the situations that are looked at.
        tell: how far it is, every so often.
    """
    numbers: dict[State, int] = {}
    for state in system.initial():
        numbers.setdefault(state, len(numbers))
    initial = tuple(numbers.values())
    states = list(numbers)
    steps: list[tuple[Step[int], ...]] = []
    outcomes: list[Outcome | None] = []
    while len(steps) < min(len(states), most):
        state = states[len(steps)]
        outcomes.append(system.outcome(state))
        found = [] if outcomes[-1] is not None else [step for step in system.steps(state) if _moves(step, state)]
        if any(step.kind is Kind.NOW for step in found):
            found = [step for step in found if step.kind is Kind.NOW or (step.kind is Kind.FAULT and step.name in at_use)]
        for step in found:
            if step.target not in numbers:
                numbers[step.target] = len(states)
                states.append(step.target)
        steps.append(tuple(dict.fromkeys(_numbered(step, numbers) for step in found)))
        if tell is not None and len(steps) % TELL_EVERY == 0:
            tell(len(states), len(steps))
    unseen = range(len(steps), len(states))
    return Graph(initial, (*steps, *(() for _ in unseen)), (*outcomes, *(None for _ in unseen)), frozenset(unseen))


def _numbered(step: Step[State], numbers: Mapping[State, int]) -> Step[int]:
    return Step(step.kind, step.name, numbers[step.target], step.result, step.uses)


def _moves(step: Step[State], state: State) -> bool:
    return step.kind not in {Kind.NOW, Kind.SOON, Kind.ANY} or step.target != state
