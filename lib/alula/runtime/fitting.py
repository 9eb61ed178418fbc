"""What may stand for a number, a truth value, a text or a list wherever a typed field, input or output is given a plain value.

Errors name ``place``, as in ``inputs of navigation.takeoff, height``, and ``kind``, the type as its user knows it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from alula.model.ros_types import INTEGER_RANGES, PRIMITIVES

Limits = tuple[int, int]
"""The lowest and the highest value of a whole number."""


def check_name(name: str, names: Collection[str], place: str) -> None:
    """Raise ValueError when there is no such name."""
    if name not in names:
        raise ValueError(f"{place} has no {name!r}; it has {', '.join(names) or 'none'}")


def is_number(value: Any) -> bool:
    """Return whether a value is one number; truth values and arrays are none."""
    return hasattr(value, "__float__") and not isinstance(value, bool) and not getattr(value, "shape", ())


def number(value: Any, kind: str, place: str) -> Any:
    """Return a number as it was given; raise ValueError for anything else."""
    if not is_number(value):
        raise ValueError(f"{place} takes a number ({kind}), not {value!r}")
    return value


def whole_number(value: Any, kind: str, place: str, limits: Limits) -> int:
    """Return a number as an int; raise ValueError when it is none, or not within the limits."""
    low, high = limits
    given = number(value, kind, place)
    if not low <= given <= high or int(given) != given:
        raise ValueError(f"{place} takes a whole number from {low} to {high} ({kind}), not {value!r}")
    return int(given)


def instance(wanted: type, value: Any, kind: str, place: str) -> Any:
    """Return a value of this class; raise ValueError for any other."""
    if isinstance(value, wanted):
        return value
    raise ValueError(f"{place} takes a {kind}, not {value!r}")


def primitive(kind: str, value: Any, place: str) -> bool | int | float | str:
    """Return a value as the ROS primitive ``kind`` holds it; raise ValueError when it does not fit."""
    match PRIMITIVES[kind]:
        case "int":
            return whole_number(value, kind, place, INTEGER_RANGES[kind])
        case "float":
            return float(number(value, kind, place))
        case "bool":
            return bool(instance(bool, value, kind, place))
        case _:
            return str(instance(str, value, kind, place))


def elements(value: Any, kind: str, place: str, *, no_lists: tuple[type, ...] = (str, bytes)) -> Iterator[tuple[str, Any]]:
    """Yield the place and the value of each element; raise ValueError for what is no list, nor of a class that counts as none."""
    if isinstance(value, no_lists) or not hasattr(value, "__iter__"):
        raise ValueError(f"{place} takes a list ({kind}), not {value!r}")
    for index, element in enumerate(value):
        yield f"{place}[{index}]", element
