"""Values and their conversions, as BT.CPP's ``Any`` makes them (``safe_any.hpp``, ``convert_impl.hpp``)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from alula.trees.script.scope import Unknown, Value
from alula.trees.values import STRING, StandIn

MAX_TEXT = 1_000_000
"""Characters of a text that a script makes: `a += a`, ticked a hundred times, must not eat the memory."""

_EXACT = 2**53 - 1
_INT64 = 2**63
_NUMBER = re.compile(
    r"[ \t\n\v\f\r]*([+-]?)(?:(0[xX](?:[0-9a-fA-F]+(?:\.[0-9a-fA-F]*)?|\.[0-9a-fA-F]+)(?:[pP][+-]?[0-9]+)?)"
    r"|((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|inf(?:inity)?|nan))",
    re.IGNORECASE,
)


class ValueMismatch(Exception):  # noqa: N818 - told to the user as a ScriptError, which has the place
    """A value that can't be what an operator needs; ``cure`` may be empty."""

    def __init__(self, message: str, cure: str = "") -> None:
        self.cure = cure
        super().__init__(message)


def is_number(value: Value) -> bool:
    """Return whether BT.CPP calculates with this value."""
    return isinstance(value, int | float)


def kind(value: Value) -> str:
    """Return how a message calls a value's type."""
    match value:
        case None:
            return "no value"
        case bool() | int():
            return "an integer"
        case float():
            return "a number"
        case str():
            return "a text"
        case Unknown():
            return "the unknown"
        case _:
            return f"a {type(value).__name__}"


def as_float(value: Value) -> float:
    """Return a number as a double; refuse an integer that no double holds, and what is no number."""
    if isinstance(value, float):
        return value
    if isinstance(value, int):
        if abs(value) > _EXACT:
            raise ValueMismatch(f"{value} is too large an integer to calculate with", "write it with a decimal point")
        return float(value)
    if isinstance(value, str):
        return float_of_text(value)
    raise ValueMismatch(f"{kind(value)} is no number")


def as_integer(value: Value) -> int:
    """Return a number as a 64-bit integer; refuse one with a fraction and one out of range."""
    if isinstance(value, int):
        return int(value)
    number = as_float(value)
    if not (-_INT64 <= number < _INT64) or number != int(number):
        raise ValueMismatch(f"{number:g} is no integer of 64 bits")
    return int(number)


def truth(value: Value) -> bool:
    """Return what BT.CPP's ``cast<bool>`` returns; raise ValueMismatch for what it refuses: texts, -1, and the integer 2."""
    if isinstance(value, int):
        if value in {0, 1}:
            return bool(value)
        raise ValueMismatch(f"the integer {value} is neither true nor false", f"compare it: `{value} != 0`")
    if isinstance(value, float):
        if value < 0:
            raise ValueMismatch(f"{value:g} is neither true nor false", "compare it with `!= 0`")
        return value != 0
    raise ValueMismatch(f"{kind(value)} is neither true nor false")


def as_text(value: Value) -> str:
    """Return a number as C++'s ``std::to_string`` writes it, a text as it is."""
    if isinstance(value, StandIn):
        return str(value.read_as(STRING))
    if isinstance(value, str):
        return value
    return f"{value:f}" if isinstance(value, float) else f"{int(as_integer(value))}"


def joined(left: str, right: str) -> str:
    """Return two texts as one, unless it gets too long."""
    if len(left) + len(right) > MAX_TEXT:
        raise ValueMismatch(f"a text of more than {MAX_TEXT} characters")
    return left + right


def float_of_text(text: str) -> float:
    """Return the number that a text begins with, as C++'s ``std::stod`` reads it; refuse a text that begins with none."""
    match = _NUMBER.match(text)
    if match is None:
        raise ValueMismatch(f"the text '{text[:40]}' is no number")
    sign, hexadecimal, decimal = match.groups()
    number = _hexadecimal(hexadecimal) if hexadecimal else float(decimal)
    if math.isinf(number) and not (decimal or "").lower().startswith("inf"):
        raise ValueMismatch(f"the text '{text[:40]}' is too large for a number")
    return -number if sign == "-" else number


def _hexadecimal(text: str) -> float:
    try:
        return float.fromhex(text)
    except OverflowError:
        return math.inf


def number_or_enum(text: str, enums: Mapping[str, float]) -> float:
    """Return the number that a text stands for where it meets a number: true, false, an enum's name, or what is written in it."""
    if text in {"true", "false"}:
        return float(text == "true")
    return float(enums[text]) if text in enums else float_of_text(text)


def fitted(value: Value, old: Value, enums: Mapping[str, float]) -> Value:
    """Return a value as an entry that holds ``old`` takes it: the entry keeps its type (``Any::copyInto``).

    A text for a number becomes a double, also in an entry of integers.
    """
    if old is None:
        return value
    if isinstance(value, str) and is_number(old):
        return number_or_enum(value, enums)
    if is_number(value) and is_number(old):
        return as_float(value) if isinstance(old, float) else _integer_like(as_integer(value), old)
    if isinstance(value, str) == isinstance(old, str) and (isinstance(value, str) or type(value) is type(old)):
        return value
    if any(isinstance(one, StandIn) and not isinstance(one, (int, float, str, list)) for one in (old, value)):
        return value  # of a type that nobody knows: it may be this one
    raise ValueMismatch(f"{kind(value)} for an entry that holds {kind(old)}", "an entry keeps its type; write another entry")


def _integer_like(value: int, old: Value) -> int:
    return bool(value) if isinstance(old, bool) and value in {0, 1} else value
