"""Figures: rates, durations and probabilities as exact numbers, or as ranges where a figure is not known better."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from alula.odds.system import DEPARTURE


@dataclass(frozen=True)
class Range:
    """From ``low`` to ``high``, both included; ``high`` None: without a bound."""

    low: Fraction
    high: Fraction | None

    @property
    def corners(self) -> tuple[Fraction, ...]:
        """Return its finite ends."""
        return tuple(dict.fromkeys(end for end in (self.low, self.high) if end is not None))

    def times(self, factor: Fraction | int) -> Range:
        """Return the range of the numbers multiplied by a positive factor."""
        return Range(self.low * factor, None if self.high is None else self.high * factor)

    def inverse(self) -> Range:
        """Return the range of the reciprocals: of mean times the rates, and of rates the mean times."""
        low = Fraction(0) if self.high is None else 1 / self.high if self.high else None
        if low is None:
            raise ValueError("0 has no reciprocal")
        return Range(low, 1 / self.low if self.low else None)

    def __add__(self, other: Range) -> Range:
        """Return the range of the sums."""
        return Range(self.low + other.low, None if self.high is None or other.high is None else self.high + other.high)


def point(value: Fraction | int | str) -> Range:
    """Return the range that holds one number only."""
    return Range(Fraction(value), Fraction(value))


NEVER = point(0)
ANY_CHANCE = Range(Fraction(0), Fraction(1))
ANY_RATE = Range(Fraction(0), None)


@dataclass(frozen=True)
class Clock:
    """Something that comes after a random time, through stages one after another; each takes an exponential time.

    ``rate`` is per second; in each stage it runs ``factors`` times as fast. Of one stage alone the time is exponential, of many alike
    nearly fixed.
    """

    rate: Range
    factors: tuple[int, ...] = (1,)


def clock(rate: Range, stages: int = 1, units: int = 1) -> Clock:
    """Return the clock of something that comes at this mean rate, per second.

    Args:
        rate: of one unit.
        stages: of a unit, alike.
        units: that all run from the beginning, each with one stage; it comes with the last of them.
    """
    return Clock(rate, tuple(range(units, 0, -1)) if units > 1 else (stages,) * stages)


@dataclass(frozen=True)
class FaultFigures:
    """The figures of one fault.

    Attributes:
        rate: how often it comes, per second; ANY_RATE: nobody knows.
        stages: of the time to it: 1 is exponential.
        units: how many there are, of which all must have failed.
        chances: how likely it comes at a use, by the use: a skill that starts, DEPARTURE.
        lasts: seconds; a range without a bound is one that nobody knows, None is for ever.
    """

    rate: Range = ANY_RATE
    stages: int = 1
    units: int = 1
    chances: Mapping[str, Range] = field(default_factory=dict)
    lasts: Range | None = ANY_RATE
    lasts_stages: int = 1
    source: str = ""

    @property
    def clock(self) -> Clock:
        """The clock of its occurrence."""
        return clock(self.rate, self.stages, self.units)

    @property
    def recovery(self) -> Clock:
        """The clock of its end."""
        return Clock(NEVER) if self.lasts is None else clock(self.lasts.inverse(), self.lasts_stages)


@dataclass(frozen=True)
class SkillFigures:
    """The figures of one skill.

    Attributes:
        results: how likely it ends with which result, where it ends by itself; a result that is missing may have all that is left.
        lasts: seconds until then; ANY_RATE: nobody knows.
        stages: of that time: 1 is exponential.
        fails: how often it ends with which result while it runs, per second.
        progress: seconds until its progress is what a mission waits for.
    """

    results: Mapping[str, Range] = field(default_factory=dict)
    lasts: Range = ANY_RATE
    stages: int = 1
    fails: Mapping[str, Range] = field(default_factory=dict)
    source: str = ""
    progress: Range = ANY_RATE

    @property
    def clock(self) -> Clock:
        """The clock of an end of its own accord."""
        return clock(self.lasts.inverse(), self.stages)

    def likelihoods(self, ends: Sequence[str]) -> list[tuple[Fraction, ...]]:
        """Return the corners of the possible distributions over these ends; the probabilities in each add up to 1."""
        return corners([self.results.get(end, ANY_CHANCE) for end in ends])


@dataclass(frozen=True)
class Figures:
    """The figures of a robot, by the names of faults and skills."""

    faults: Mapping[str, FaultFigures] = field(default_factory=dict)
    skills: Mapping[str, SkillFigures] = field(default_factory=dict)

    def fault(self, name: str) -> FaultFigures:
        """Return the figures of a fault, or of an end ``skillset.skill END``; one without figures may come at any time."""
        skill, _, end = name.partition(" ")
        fails = self.skill(skill).fails
        return self.faults.get(name) or (FaultFigures(rate=fails[end], lasts=None) if end in fails else FaultFigures())

    def skill(self, name: str) -> SkillFigures:
        """Return the figures of a skill; one without figures may end at any time, in any way."""
        return self.skills.get(name, SkillFigures())

    @property
    def at_use(self) -> frozenset[str]:
        """The faults that come at a use of something."""
        return frozenset(name for name, fault in self.faults.items() if fault.chances)

    def named(self, name: Callable[[str], str]) -> Figures:
        """Return the figures under other names: ``name`` maps each name of a fault or skill here to the new one."""
        faults = {
            name(what): replace(one, chances={use if use == DEPARTURE else name(use): chance for use, chance in one.chances.items()})
            for what, one in self.faults.items()
        }
        return Figures(faults, {name(skill): one for skill, one in self.skills.items()})

    def with_fault(self, name: str, **changed: object) -> Figures:
        """Return the figures with some of a fault's changed."""
        fault = replace(self.fault(name), **changed)  # type: ignore[arg-type]  # the fields' own names
        return replace(self, faults={**self.faults, name: fault})


def corners(ranges: Sequence[Range]) -> list[tuple[Fraction, ...]]:
    """Return the corners of the distributions whose parts are in these ranges; none where no such parts add up to 1.

    In a corner, all parts but one are at an end of their range, and that one takes what is left.
    """
    found: dict[tuple[Fraction, ...], None] = {}
    for free, among in enumerate(ranges):
        others = [one.corners for place, one in enumerate(ranges) if place != free]
        for chosen in itertools.product(*others):
            left = 1 - sum(chosen, Fraction(0))
            if among.low <= left and (among.high is None or left <= among.high):
                found[(*chosen[:free], left, *chosen[free:])] = None
    return list(found)
