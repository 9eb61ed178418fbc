"""Mission time without a clock: what has begun runs out at some tick, sooner or later, and stays so."""

from __future__ import annotations

import math
from collections.abc import Hashable

from alula.prove.mission.oracle import Oracle


class Moment:
    """A moment, now or in the past. ``passed`` is the longest time that has passed since, as far as was asked; in the askers' unit.

    Nodes compute with it as with the nanoseconds of a clock: ``now + duration`` is when something is over, ``now - since`` how long
    ago it was. Time that nobody has asked for may have passed or not.
    """

    __slots__ = ("_not_passed", "oracle", "passed")

    def __init__(self, oracle: Oracle, passed: float = -math.inf, *, now: bool = False) -> None:
        self.oracle = oracle
        self.passed = 0.0 if now else max(passed, 0.0)
        self._not_passed = 0.0 if now else math.inf

    def reached(self, duration: float) -> bool:
        """Tell whether so much time has passed since; the same answer for a whole tick, and for ever once it is yes."""
        if duration <= self.passed:
            return True
        if duration > self._not_passed or duration == math.inf:
            return False
        if self.oracle.choose(("time", f"{duration:g}")):
            self.passed = duration
            return True
        self._not_passed = math.nextafter(duration, 0.0)
        return False

    @property
    def frozen(self) -> Hashable:
        """What is known of it."""
        return ("since", self.passed)

    def __add__(self, duration: float) -> Later:
        return Later(self, float(duration))

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
    """A moment so much time after another."""

    __slots__ = ("duration", "since")

    def __init__(self, since: Moment, duration: float) -> None:
        self.since = since
        self.duration = duration

    @property
    def over(self) -> bool:
        """Tell whether it has come."""
        return self.since.reached(self.duration)

    @property
    def frozen(self) -> Hashable:
        """What is known of it."""
        return ("over",) if self.since.passed >= self.duration else ("until", self.duration)


class Elapsed:
    """The time since a moment, in ``factor`` times the askers' unit."""

    __slots__ = ("_factor", "_since")

    def __init__(self, since: Moment, factor: float = 1.0) -> None:
        self._since = since
        self._factor = factor

    def __ge__(self, duration: float) -> bool:
        return self._since.reached(duration / self._factor)

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


def thawed(oracle: Oracle, frozen: Hashable) -> Moment | Later:
    """Return what a frozen moment was; raises TypeError for anything else."""
    match frozen:
        case ("since", float(passed)):
            return Moment(oracle, passed)
        case ("over",):
            return Later(Moment(oracle, math.inf), 0.0)
        case ("until", float(duration)):
            return Later(Moment(oracle), duration)
    raise TypeError(frozen)
