"""Values that the search does not know: numbers between two bounds, and anything else.

They stand on the blackboard in the place of what a world, a function or a node of a robot's own would have written. Scripts calculate
with them as with numbers; what their bounds do not decide may be either way, and holds of the value from then on.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from alula.prove.mission.oracle import Oracle, UndecidedError
from alula.trees.values import ANY, BOOL, NUMBERS, STRING, PortType, StandIn

if TYPE_CHECKING:
    from typing import Self, SupportsIndex  # of Python 3.11

LARGE = 2.0**53
"""Bounds of C's numbers are compared with, too; no unknown number is meant to be beyond."""
COMPARE = "compare"
"""The kind of questions that distinguish two values: ``("compare", what, symbol, other)``."""
ORDERS: dict[str, Callable[[str, str], bool]] = {"==": operator.eq, "<": operator.lt, ">": operator.gt}


@dataclass(frozen=True)
class Distance:
    """The distance of an unknown number from another: scripts only compare it with nearly zero, and that comparison is a choice."""

    is_none: Callable[[], bool]

    def __abs__(self) -> Distance:
        return self

    def __le__(self, _near: float) -> bool:
        return self.is_none()


class MisfitError(ValueError):
    """An unknown value is assumed to be one that a port can't read."""


def fit(oracle: Oracle, what: str, type_: PortType) -> None:
    """Choose whether a value can be read as one of a type; raises MisfitError where it can't."""
    if not oracle.choose((COMPARE, what, "of the type", type_.name), (True, False)):
        raise MisfitError(f"{what} is no {type_.name}")


# --- anything ------------------------------------------------------------------------------------------------------------


class Unknown(StandIn):
    """A value of which nothing is known, such as a route; whether it is equal to another one is a choice.

    One that ``fits`` is of whatever type a port reads it as.
    """

    __slots__ = ("fits", "oracle", "what")

    def __init__(self, oracle: Oracle, what: str, *, fits: bool = False) -> None:
        self.oracle, self.what, self.fits = oracle, what, fits

    @property
    def frozen(self) -> Hashable:
        """It as a value that can be compared without a choice."""
        return ("any", self.what, self.fits)

    def read_as(self, type_: PortType) -> object:
        """Return the value that a port reads; raises UndecidedError where that has to be a number, and nothing says that it is one."""
        if type_ is ANY:
            return self
        if self.fits:
            return unknown(self.oracle, self.what, type_)
        if type_ is STRING or type_.item is not None:
            fit(self.oracle, self.what, type_)
            return unknown(self.oracle, self.what, type_)
        raise UndecidedError(f"a port reads {self.what} as {type_.name}, and what has written it does not say of which type it is")

    def __eq__(self, other: object) -> bool:
        if other is None or other is self:
            return other is self
        name = str(getattr(other, "what", other))
        return bool(self.oracle.choose((COMPARE, self.what, "==", "what it was" if name == self.what else name)))

    def __hash__(self) -> int:
        raise UndecidedError(f"the value of {self.what} is needed")

    def __bool__(self) -> bool:
        raise UndecidedError(f"the value of {self.what} is needed")


class UnknownItems(list[object], StandIn):
    """A list of which no more is known than the type of its items: there is another one, or not."""

    __slots__ = ("item", "oracle", "what")

    def __init__(self, oracle: Oracle, what: str, item: PortType) -> None:
        super().__init__()
        self.oracle, self.what, self.item = oracle, what, item

    @property
    def frozen(self) -> Hashable:
        """It as a value that can be compared without a choice."""
        return ("items", self.what, self.item)

    def read_as(self, type_: PortType) -> object:
        """Return itself where a port reads a list or anything; raises MisfitError otherwise."""
        if type_ is not ANY and type_.item is None:
            raise MisfitError(f"{self.what} is no {type_.name}")
        return self

    def __bool__(self) -> bool:
        return bool(self.oracle.choose((COMPARE, f"the number of items left of {self.what}", ">", "0")))

    def __len__(self) -> int:
        raise UndecidedError(f"the length of {self.what} is needed")

    def __iter__(self) -> Iterator[object]:
        raise UndecidedError(f"the items of {self.what} are needed")

    def pop(self, _index: SupportsIndex = -1) -> object:
        """Return an item."""
        return unknown(self.oracle, f"an item of {self.what}", self.item)


# --- texts ---------------------------------------------------------------------------------------------------------------


class UnknownText(str, StandIn):
    """A text known only by answers: whether it equals another one is a choice.

    What needs its letters raises UndecidedError.
    """

    __slots__ = ("known", "oracle", "others", "what")
    oracle: Oracle
    what: str
    known: str | None
    others: frozenset[str]

    def __new__(cls, oracle: Oracle, what: str, others: frozenset[str] = frozenset()) -> Self:
        """Make one; ``what`` is what counterexamples call it, ``others`` are texts that it is not."""
        made = super().__new__(cls, f"(unknown: {what})")
        made.oracle, made.what, made.known, made.others = oracle, what, None, others
        return made

    @property
    def frozen(self) -> Hashable:
        """It as a value that can be compared without a choice; one that is known by now is a text as any other."""
        return ("text", self.what, self.others) if self.known is None else self.known

    def read_as(self, type_: PortType) -> object:
        """Return the value that a port reads; raises MisfitError where the text is assumed to have no value of the port's type."""
        if self.known is not None:
            return type_.parse(self.known)
        if type_ in {STRING, ANY}:
            return self
        if type_.item is not STRING:
            fit(self.oracle, self.what, type_)
        return unknown(self.oracle, self.what, type_)

    def says(self, number: float) -> bool:
        """Return whether the text stands for a number."""
        return self._asked("a text for", f"{number:g}")

    def _asked(self, symbol: str, other: str) -> bool:
        return bool(self.oracle.choose((COMPARE, self.what, symbol, other)))

    def _decided(self, symbol: str, other: object) -> bool:
        if not isinstance(other, str):
            raise UndecidedError(f"{self.what}, a text, meets {other!r}")
        if isinstance(other, UnknownText):
            if other.known is None:
                return self._asked(symbol, other.what)
            other = other.known
        if self.known is not None:
            return ORDERS[symbol](self.known, other)
        if symbol != "==":
            return self._asked(symbol, f"'{other}'")
        if other not in self.others and self._asked(symbol, f"'{other}'"):
            self.known = other
            return True
        self.others |= {other}
        return False

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


class NumberAsText(UnknownText):
    """An unknown number as a port of text reads it."""

    __slots__ = ("number",)
    number: UnknownNumber

    @classmethod
    def of(cls, number: UnknownNumber) -> Self:
        """Return a number as text."""
        made = cls(number.oracle, number.what)
        made.number = number
        return made

    def says(self, number: float) -> bool:
        """Return whether it is this number."""
        return self.number == number

    def _decided(self, symbol: str, other: object) -> bool:
        """Return whether it is a text, which has to be written as numbers are."""
        if symbol != "==" or not isinstance(other, str):
            raise UndecidedError(f"the letters of {self.what}, a number, are needed")
        # Those who compare it with a text that is known ask for the number next.
        return isinstance(other, UnknownText) and (other is self or self._asked(symbol, other.what))

    __hash__ = UnknownText.__hash__


# --- numbers -------------------------------------------------------------------------------------------------------------


class UnknownNumber(float, StandIn):
    """A number from ``low`` to ``high``; a comparison that these do not decide is a choice.

    One that is a ``whole`` number is bounded by each answer from then on; any other may be NaN, which is below and above all.
    """

    __slots__ = ("high", "low", "oracle", "others", "what", "whole")
    high: float
    low: float
    oracle: Oracle
    what: str
    whole: bool
    others: frozenset[float]
    """Numbers between the bounds that it is not."""

    def __new__(
        cls,
        oracle: Oracle,
        what: str,
        low: float = -math.inf,
        high: float = math.inf,
        *,
        whole: bool = False,
        others: frozenset[float] = frozenset(),
    ) -> Self:
        """Make one; ``what`` is what counterexamples call it."""
        made = super().__new__(cls, math.nan)
        made.oracle, made.what, made.low, made.high, made.whole, made.others = oracle, what, low, high, whole, others
        return made

    @property
    def frozen(self) -> Hashable:
        """It as a value that can be compared without a choice."""
        return (self.what, self.low, self.high, self.whole, self.others)

    def read_as(self, type_: PortType) -> object:
        """Return the value that a port reads; raises MisfitError where the number is assumed not to be one of the port's type."""
        if type_ is BOOL:
            return self != 0
        if type_ is STRING:
            return NumberAsText.of(self)
        if type_ is ANY or (type_ in NUMBERS and type_.limits is None):
            return self
        if type_.limits is None:
            raise MisfitError(f"{self.what} is no {type_.name}")
        least, most = map(float, type_.limits)
        if not (self.whole and least <= self.low and self.high <= most):
            fit(self.oracle, self.what, type_)
            self.low, self.high, self.whole = max(self.low, least), min(self.high, most), True
        return self

    @property
    def keeps_answers(self) -> bool:
        """Whether an answer about it holds from then on."""
        return self.whole

    # --- comparisons -------------------------------------------------------------------------------------------------

    def _asked(self, symbol: str, other: float) -> bool:
        return bool(self.oracle.choose((COMPARE, self.what, symbol, _name(other))))

    def _decided(self, sure: bool, impossible: bool, symbol: str, other: float) -> bool:  # noqa: FBT001
        if sure or impossible or (symbol == "==" and other in self.others):
            return sure
        answer = self._asked(symbol, other)
        if self.keeps_answers and not isinstance(other, UnknownNumber):
            self._bound(symbol, other, answer=answer)
        return answer

    def _bound(self, symbol: str, other: float, *, answer: bool) -> None:
        """Take note of an answer."""
        if symbol == "==":
            self.low, self.high, self.others = (other, other, self.others) if answer else (self.low, self.high, self.others | {other})
            return
        below, above = math.nextafter(other, -math.inf), math.nextafter(other, math.inf)
        least, most = {"<": (other, below), "<=": (above, other), ">": (above, other), ">=": (other, below)}[symbol]
        if (symbol in {"<", "<="}) == answer:
            self.high = min(self.high, most)
        else:
            self.low = max(self.low, least)

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
    if type_ is STRING:
        return UnknownText(oracle, what)
    if type_.item is not None:
        return UnknownItems(oracle, what, type_.item)
    low, high = map(float, (0, 1) if type_ is BOOL else type_.limits or (-math.inf, math.inf))
    number = type_ in NUMBERS or type_.limits is not None
    return UnknownNumber(oracle, what, low, high, whole=math.isfinite(low)) if number else Unknown(oracle, what)


def any_value(oracle: Oracle, what: str, type_: PortType | None) -> object:
    """Return an unknown value of a type; without a type, one that fits wherever it is read."""
    return Unknown(oracle, what, fits=True) if type_ is None else unknown(oracle, what, type_)


def is_unknown(value: object) -> bool:
    """Return whether the search does not know a value."""
    return isinstance(value, StandIn)
