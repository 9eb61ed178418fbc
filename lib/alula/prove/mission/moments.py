"""Mission time without a clock: what has begun runs out at some tick, sooner or later, and stays so."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Final

from alula.prove.mission.oracle import Oracle
from alula.prove.mission.unknown import COMPARE, UnknownNumber

PASSED = "the time that has passed"
OVER: Final = ("over",)
"""A later moment that has come."""


class Moment:
    """A moment, now or in the past. ``passed`` is the longest time that has passed since, as far as was asked; in the askers' unit.

    Nodes compute with it as with the nanoseconds of a clock: ``now + duration`` is when something is over, ``now - since`` how long
    ago it was. Time that nobody has asked for may have passed or not. ``told`` is what was answered of this moment by duration, whoever has
    asked: two waits of one length that began in one tick are over in one tick.
    """

    __slots__ = ("_not_passed", "oracle", "passed", "told")

    def __init__(self, oracle: Oracle, passed: float = -math.inf, *, now: bool = False, told: dict[float, bool] | None = None) -> None:
        self.oracle = oracle
        self.told = {} if told is None else told
        self.passed = 0.0 if now else max(passed, 0.0)
        self._not_passed = 0.0 if now else math.inf

    def reached(self, duration: float | str) -> bool:
        """Return whether a duration has passed since; the same answer for a whole tick, and for ever once it is yes.

        A duration that is not known is given by its name: it may be over in any tick.
        """
        if isinstance(duration, str):
            return not self.oracle.choose((COMPARE, duration, ">", PASSED))
        if duration <= self.passed:
            return True
        if duration > self._not_passed or duration == math.inf:
            return False
        if duration not in self.told:
            self.told[duration] = bool(self.oracle.choose(("time", f"{duration:g}")))
        if self.told[duration]:
            self.passed = duration
            return True
        self._not_passed = math.nextafter(duration, 0.0)
        return False

    @property
    def frozen(self) -> Hashable:
        """What is known of it, as a value that can be compared."""
        return ("since", self.passed)

    def __add__(self, duration: float) -> Later:
        return Later(self, _known(duration))

    def __sub__(self, since: object) -> Elapsed:
        return Elapsed(since if isinstance(since, Moment) else Moment(self.oracle, math.inf))

    def __truediv__(self, _unit: float) -> Moment:
        return self

    def __lt__(self, other: object) -> bool:
        return isinstance(other, Later) and not other.over

    def __ge__(self, other: object) -> bool:
        return not self < other

    def __gt__(self, other: object) -> bool:
        return not self < other

    def __le__(self, other: object) -> bool:
        return self < other


class Later:
    """A moment so much time after another; of a time that is not known ``duration`` is its name."""

    __slots__ = ("duration", "since")

    def __init__(self, since: Moment, duration: float | str) -> None:
        self.since = since
        self.duration = duration

    @property
    def over(self) -> bool:
        """Return whether the moment has come."""
        return self.since.reached(self.duration)

    @property
    def frozen(self) -> Hashable:
        """What is known of it, as a value that can be compared."""
        over = not isinstance(self.duration, str) and self.since.passed >= self.duration
        return OVER if over else ("until", self.duration)


class Elapsed:
    """The time since a moment, in ``factor`` times the askers' unit."""

    __slots__ = ("_factor", "_since")

    def __init__(self, since: Moment, factor: float = 1.0) -> None:
        self._since = since
        self._factor = factor

    def __ge__(self, duration: float) -> bool:
        return self._since.reached(_known(duration / self._factor))

    def __gt__(self, duration: float) -> bool:
        return self >= duration

    def __lt__(self, duration: float) -> bool:
        return not self >= duration

    def __le__(self, duration: float) -> bool:
        return not self >= duration

    def __truediv__(self, unit: float) -> Elapsed:
        return Elapsed(self._since, self._factor / unit)

    def __mul__(self, factor: float) -> Elapsed:
        return Elapsed(self._since, self._factor * factor)


def _known(duration: float) -> float | str:
    """Return a duration, or the name of one that is not known."""
    return duration.what if isinstance(duration, UnknownNumber) else float(duration)


def numbered(values: Sequence[Hashable], moments: Mapping[int, tuple[str, Moment | Later]]) -> tuple[Hashable, ...]:
    """Return frozen values with a number for each moment that several are of, as far as these may ask for the same duration.

    ``moments`` are what they were, by their places, with the names of the nodes' attributes: what is counted for another reason is asked
    for another duration, and to know that it is of the same moment would only make more memories.
    """
    places: dict[Hashable, list[int]] = {}
    for place, (name, one) in moments.items():
        if values[place] == one.frozen != OVER:
            key = (id(one.since.told), one.duration) if isinstance(one, Later) else (id(one.told), name)
            places.setdefault(key, []).append(place)
    found = list(values)
    for number, several in enumerate(known for known in places.values() if len(known) > 1):
        for place in several:
            found[place] = ("shared", values[place], number)
    return tuple(found)


class Thawing:
    """Makes the moments of one memory from their frozen values; moments that were one share what is known of it."""

    def __init__(self, oracle: Oracle) -> None:
        self._oracle = oracle
        self._told: dict[Hashable, dict[float, bool]] = {}

    def moment(self, frozen: Hashable) -> Moment | Later:
        """Return what a frozen moment was; raises TypeError for anything else."""
        match frozen:
            case ("shared", one, number):
                return self._moment(one, self._told.setdefault(number, {}))
        return self._moment(frozen, {})

    def _moment(self, frozen: Hashable, told: dict[float, bool]) -> Moment | Later:
        match frozen:
            case ("since", float(passed)):
                told[passed] = True
                return Moment(self._oracle, passed, told=told)
            case ("over",):
                return Later(Moment(self._oracle, math.inf), 0.0)
            case ("until", float() | str() as duration):
                return Later(Moment(self._oracle, told=told), duration)
        raise TypeError(frozen)
