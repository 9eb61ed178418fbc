"""Types of ports and of entries of the blackboard: how their text is read, and what other values are taken for one of them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from alula.common.public import public
from alula.trees.status import ANSWERS, NAMES, Skipped, Status

LARGEST_UINT = 2**32 - 1
LARGEST_INT = 2**31 - 1
BOOLEANS = {"0": False, "1": True, "false": False, "true": True, "False": False, "True": True, "FALSE": False, "TRUE": True}


_WHOLE = re.compile(r"-?[0-9]{1,18}")
_WHOLE_PORT = re.compile(r"-?[0-9]{1,20}[ \t\r\n]*", re.ASCII)
"""A port's: blanks and a plus before it, and signs between digits are refused, as BehaviorTree.CPP refuses them."""
_NUMBER = re.compile(r"-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_LONGEST = 400


def literal(text: str) -> object:
    """Return what plain text is to a script: the number that it is all of, else itself."""
    if _WHOLE.fullmatch(text):
        return int(text)
    if len(text) > _LONGEST or not _NUMBER.fullmatch(text):
        return text
    number = float(text)
    return number if math.isfinite(number) else text


class StandIn:
    """A placeholder for an unknown value, as in a search of all runs; it decides what a port reads of it."""

    __slots__ = ()

    def read_as(self, type_: PortType) -> object:
        """Return what a port of a type reads; raises ValueError where the value may be none that it can read."""
        raise NotImplementedError

    def says(self, number: float) -> bool:
        """Return whether the value is a text for this number."""
        raise NotImplementedError


@public("alula.trees")
@dataclass(frozen=True, eq=False)
class PortType:
    """A type of ports: ``parse`` reads text, ``cast`` takes a value that is no text; both raise ValueError."""

    name: str
    parse: Callable[[str], object] = field(repr=False)
    cast: Callable[[object], object] = field(repr=False)
    limits: tuple[int, int] | None = field(default=None, repr=False)
    """Of whole numbers the least and the largest; None: a type of anything else."""
    item: PortType | None = field(default=None, repr=False)
    """Of lists the type of their items."""

    def read(self, value: object) -> object:
        """Return a value of this type made of any other; raises ValueError."""
        if isinstance(value, StandIn):
            return value.read_as(self)
        return self.parse(value) if isinstance(value, str) else self.cast(value)


def _wrong(value: object, name: str) -> ValueError:
    return ValueError(f"{shown(value)} is no {name}")


def shown(value: object) -> str:
    """Return a value as messages and texts have it."""
    if isinstance(value, Status | Skipped):
        return NAMES[value]
    return f"'{value}'" if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else str(value)


def whole(name: str, least: int, largest: int) -> PortType:
    """Return the type of whole numbers from one to another."""

    def cast(value: object) -> int:
        if not isinstance(value, int | float) or not math.isfinite(value) or value != int(value) or not least <= value <= largest:
            raise _wrong(value, name)
        return int(value)

    def parse(text: str) -> int:
        number = int(text) if _WHOLE_PORT.fullmatch(text) else None
        if number is None or not least <= number <= largest:
            raise _wrong(text, name)
        return number

    return PortType(name, parse, cast, (least, largest))


def _parse_double(text: str) -> float:
    try:
        if "_" not in text:
            return float(text)
    except ValueError:
        pass
    raise _wrong(text, "double")


def _cast_double(value: object) -> float:
    if isinstance(value, int | float):
        return float(value)
    raise _wrong(value, "double")


def _parse_bool(text: str) -> bool:
    if text not in BOOLEANS:
        raise _wrong(text, "bool")
    return BOOLEANS[text]


def truth(value: object) -> bool:
    """Return a number as yes or no: what a condition's script answers; raises ValueError."""
    if isinstance(value, int | float):
        return value != 0
    raise _wrong(value, "bool")


def as_text(value: object) -> str:
    """Return a value as a port of text gives it: a double as C writes it, with six digits."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, int | float):
        return f"{value:f}" if isinstance(value, float) else str(value)
    raise _wrong(value, "std::string")


def _parse_status(text: str) -> object:
    if text not in ANSWERS:
        raise _wrong(text, "BT::NodeStatus")
    return ANSWERS[text]


def _cast_status(value: object) -> object:
    if isinstance(value, Status | Skipped):
        return value
    raise _wrong(value, "BT::NodeStatus")


def _same(value: object) -> object:
    return value


INT = whole("int", -LARGEST_INT - 1, LARGEST_INT)
UINT = whole("unsigned int", 0, LARGEST_UINT)
DOUBLE = PortType("double", _parse_double, _cast_double)
BOOL = PortType("bool", _parse_bool, truth)
STRING = PortType("std::string", str, as_text)
STATUS = PortType("BT::NodeStatus", _parse_status, _cast_status)
ANY = PortType("BT::AnyTypeAllowed", _same, _same)
SIZED = {
    **{f"int{bits}": whole(f"int{bits}", -(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 64)},
    **{f"uint{bits}": whole(f"uint{bits}", 0, 2**bits - 1) for bits in (8, 16, 64)},
}
"""Whole numbers of other sizes than C's ``int``."""
NUMBERS = (INT, UINT, DOUBLE, BOOL, *SIZED.values())
TYPES = {one.name: one for one in (*NUMBERS, STRING, STATUS, ANY)}


@public("alula.trees")
def list_of(item: PortType) -> PortType:
    """Return the type of a list, whose items stand in text between semicolons."""
    name = f"std::vector<{item.name}>"

    def parse(text: str) -> object:
        return [item.read(part) for part in text.removesuffix(";").split(";")] if text else []

    def cast(value: object) -> object:
        if isinstance(value, list | tuple):
            return [item.read(part) for part in value]
        raise _wrong(value, name)

    return PortType(name, parse, cast, item=item)
