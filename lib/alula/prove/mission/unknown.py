"""Values that the search does not know: numbers between two bounds, and anything else.

They stand on the blackboard in the place of what a world, a function or a node of a robot's own would have written. Scripts calculate
with them as with numbers; what their bounds do not decide may be either way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from alula.prove.mission.oracle import Oracle, UndecidedError
from alula.trees.values import BOOL, NUMBERS, STRING, PortType

if TYPE_CHECKING:
    from typing import Self  # of Python 3.11

LARGE = 2.0**53
"""Bounds of C's numbers are compared with, too; no unknown number is meant to be beyond."""


@dataclass(frozen=True)
class Distance:
    """How far a number that is not known is from another: scripts only ask whether that is next to nothing, and this asks for it then."""

    is_none: Callable[[], bool]

    def __abs__(self) -> Distance:
        return self

    def __le__(self, _near: float) -> bool:
        return self.is_none()


class Unknown:
    """A value of which nothing is known, such as a route."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Unknown)

    def __hash__(self) -> int:
        return 0


UNKNOWN = Unknown()


class UnknownText(str):
    """A text of which nothing is known; each comparison is a choice. What needs its letters raises UndecidedError."""

    __slots__ = ("oracle", "what")
    oracle: Oracle
    what: str

    def __new__(cls, oracle: Oracle, what: str) -> Self:
        """Make one; ``what`` is what counterexamples call it."""
        made = super().__new__(cls, f"(unknown: {what})")
        made.oracle, made.what = oracle, what
        return made

    @property
    def frozen(self) -> Hashable:
        """It as a value that can be compared without a choice."""
        return ("text", self.what)

    def _decided(self, symbol: str, other: object) -> bool:
        if not isinstance(other, str):
            raise UndecidedError(f"{self.what}, a text, meets {other!r}")
        name = other.what if isinstance(other, UnknownText) else f"'{other}'"
        return bool(self.oracle.choose(("compare", self.what, symbol, name)))

    def __eq__(self, other: object) -> bool:
        return self._decided("==", other)

    def __ne__(self, other: object) -> bool:
        return not self._decided("==", other)

    def __lt__(self, other: object) -> bool:
        return self._decided("<", other)

    def __ge__(self, other: object) -> bool:
        return not self._decided("<", other)

    def __gt__(self, other: object) -> bool:
        return self._decided(">", other)

    def __le__(self, other: object) -> bool:
        return not self._decided(">", other)

    def __hash__(self) -> int:
        raise UndecidedError(f"the value of {self.what} is needed")

    def __len__(self) -> int:
        raise UndecidedError(f"the length of {self.what} is needed")

    def __bool__(self) -> bool:
        raise UndecidedError(f"the value of {self.what} is needed")

    def __str__(self) -> str:
        return self


class UnknownNumber(float):
    """A number from ``low`` to ``high``; a comparison that these do not decide is a choice."""

    __slots__ = ("high", "low", "oracle", "what")
    high: float
    low: float
    oracle: Oracle
    what: str

    def __new__(cls, oracle: Oracle, what: str, low: float = -math.inf, high: float = math.inf) -> Self:
        """Make one; ``what`` is what counterexamples call it."""
        made = super().__new__(cls, math.nan)
        made.oracle, made.what, made.low, made.high = oracle, what, low, high
        return made

    @property
    def frozen(self) -> Hashable:
        """It as a value that can be compared without a choice."""
        return (self.what, self.low, self.high)

    # --- comparisons -------------------------------------------------------------------------------------------------

    def _decided(self, sure: bool, impossible: bool, symbol: str, other: float) -> bool:  # noqa: FBT001
        if sure or impossible:
            return sure
        return bool(self.oracle.choose(("compare", self.what, symbol, _name(other))))

    def __lt__(self, other: object) -> bool:
        low, high = _bounds(other)
        return self._decided(self.high < low, self.low >= high, "<", _number(other))

    def __le__(self, other: object) -> bool:
        low, high = _bounds(other)
        return self._decided(self.high <= low, self.low > high, "<=", _number(other))

    def __gt__(self, other: object) -> bool:
        low, high = _bounds(other)
        return self._decided(self.low > high, self.high <= low, ">", _number(other))

    def __ge__(self, other: object) -> bool:
        low, high = _bounds(other)
        return self._decided(self.low >= high, self.high < low, ">=", _number(other))

    def __eq__(self, other: object) -> bool:
        low, high = _bounds(other)
        return self._decided(self.low == self.high == low == high, self.high < low or self.low > high, "==", _number(other))

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = float.__hash__

    # --- arithmetic --------------------------------------------------------------------------------------------------

    def _made(self, low: float, high: float) -> UnknownNumber:
        lost = math.isnan(low) or math.isnan(high)
        return UnknownNumber(self.oracle, self.what, -math.inf if lost else low, math.inf if lost else high)

    def __add__(self, other: object) -> UnknownNumber:
        low, high = _bounds(other)
        return self._made(self.low + low, self.high + high)

    __radd__ = __add__

    def __sub__(self, other: object) -> UnknownNumber:
        low, high = _bounds(other)
        return self._made(self.low - high, self.high - low)

    def __rsub__(self, other: object) -> UnknownNumber:
        low, high = _bounds(other)
        return self._made(low - self.high, high - self.low)

    def __neg__(self) -> UnknownNumber:
        return self._made(-self.high, -self.low)

    def __abs__(self) -> UnknownNumber:
        least = 0.0 if self.low <= 0.0 <= self.high else min(abs(self.low), abs(self.high))
        return self._made(least, max(abs(self.low), abs(self.high)))

    def __mul__(self, other: object) -> UnknownNumber:
        return self._made(math.nan, math.nan)

    __rmul__ = __truediv__ = __rtruediv__ = __mul__

    def __float__(self) -> float:
        raise UndecidedError(f"the value of {self.what} is needed")

    def __int__(self) -> int:
        raise UndecidedError(f"the value of {self.what} is needed")

    __trunc__ = __int__

    def __bool__(self) -> bool:
        return self != 0

    def __repr__(self) -> str:
        return f"<{self.what}: {self.low:g} to {self.high:g}>"

    __str__ = __repr__

    def __format__(self, _: str) -> str:
        return repr(self)


def _bounds(other: object) -> tuple[float, float]:
    if isinstance(other, UnknownNumber):
        return other.low, other.high
    number = _number(other)
    if abs(number) >= LARGE:
        number = math.copysign(math.inf, number)
    return number, number


def _number(other: object) -> float:
    if isinstance(other, UnknownNumber):
        return other
    if isinstance(other, int | float):
        return float(other)
    raise UndecidedError(f"an unknown number meets {other!r}")


def _name(number: float) -> str:
    return number.what if isinstance(number, UnknownNumber) else f"{number:g}"


def unknown(oracle: Oracle, what: str, type_: PortType) -> object:
    """Return a value of a type of which nothing is known."""
    if type_ is BOOL:
        return UnknownNumber(oracle, what, 0.0, 1.0)
    if type_ is STRING:
        return UnknownText(oracle, what)
    return UnknownNumber(oracle, what) if type_ in NUMBERS else UNKNOWN


def is_unknown(value: object) -> bool:
    """Tell whether the search does not know a value of the blackboard."""
    return isinstance(value, Unknown | UnknownNumber | UnknownText)
