"""Draws the runs of a campaign: which scenario, which faults, when, and the run's own seed. The same seed draws the same runs."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from alula.common.faults import FaultRequest

MAX_SEED = 2**31 - 1


@dataclass(frozen=True)
class Kind:
    """A fault to draw: its name and way; it lasts ``lasts_s`` seconds, or, where that is None, as long as the draw says."""

    what: str
    how: str
    lasts_s: float | None = None


Kinds = Sequence[Kind]


@dataclass(frozen=True)
class DrawnRun:
    """A run as it was drawn; ``seed`` is the run's own, ``faults`` are in the order of time."""

    number: int
    scenario: str
    seed: int
    faults: tuple[FaultRequest, ...]


@dataclass(frozen=True)
class Draw:
    """The ranges from which the faults of runs are drawn, times in seconds.

    Attributes:
        faults: by scenario, entries to draw from: a run takes from ``least`` to ``most`` of them, and of each one kind, all with the same
            chance. No thing is in two entries, so none fails twice in a run.
        in_turn: by scenario, lists of faults: instead, the runs of a scenario take one list after another, and begin again after the last.
        least: so many faults at least.
        most: so many at most.
        at_s: when a fault begins, after the departure.
        lasts_s: how long a fault without a duration of its own lasts, in half of the cases; None: it stays.
    """

    faults: Mapping[str, Sequence[Kinds]]
    in_turn: Mapping[str, Sequence[Kinds]]
    least: int
    most: int
    at_s: tuple[float, float]
    lasts_s: tuple[float, float] | None

    def runs(self, scenarios: Sequence[str], count: int, seed: int) -> Iterator[DrawnRun]:
        """Yield ``count`` drawn runs, one scenario after another; a greater ``count`` does not change the first ones."""
        turns = Counter[str]()
        for number in range(count):
            chance = random.Random(f"{seed} {number}")  # noqa: S311 - nothing here is secret
            scenario = scenarios[number % len(scenarios)]
            own_seed = chance.randrange(MAX_SEED + 1)
            kinds = self._in_turn(scenario, turns[scenario]) if self.in_turn else self._drawn(scenario, chance)
            faults = sorted((self._fault(kind, chance) for kind in kinds), key=lambda one: (one.begin_s or 0.0, one.what))
            yield DrawnRun(number, scenario, own_seed, tuple(faults))
            turns[scenario] += 1

    def _in_turn(self, scenario: str, turn: int) -> Kinds:
        lists = self.in_turn[scenario]
        return lists[turn % len(lists)]

    def _drawn(self, scenario: str, chance: random.Random) -> Kinds:
        entries = chance.sample(self.faults[scenario], chance.randint(self.least, self.most))
        return [chance.choice(entry) for entry in entries]

    def _fault(self, kind: Kind, chance: random.Random) -> FaultRequest:
        begin_s, lasts_s = round(chance.uniform(*self.at_s), 1), kind.lasts_s
        if lasts_s is None and self.lasts_s is not None and chance.random() < 0.5:
            lasts_s = chance.uniform(*self.lasts_s)
        return FaultRequest(kind.what, kind.how, begin_s, None if lasts_s is None else round(begin_s + lasts_s, 1))
