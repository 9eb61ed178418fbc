"""Inputs and outputs without message classes: checked like a message's fields, handed over as copies."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

from skill_language.model import Parameter
from skill_language.ros_types import PRIMITIVES, RosType

_VECTOR = ("x", "y", "z")
Types = Mapping[str, RosType]
"""What the types of the models are in ROS, as a ``Robot`` has them."""


def fit(parameters: Sequence[Parameter], values: Mapping[str, object], place: str, types: Types) -> dict[str, object]:
    """Return copies of values as the parameters' types hold them.

    A message may be given as an object with its fields, as a mapping of them, or, when it is no list, as three numbers for x, y
    and z; the last two become namespaces.

    Raises:
        ValueError: a name or a value does not fit; the message names ``place`` and the parameter.
    """
    declared = {parameter.name: parameter for parameter in parameters}
    for name in values:
        if name not in declared:
            raise ValueError(f"{place} has no {name!r}; it has {', '.join(declared) or 'none'}")
    return {name: _fitting(_ros_type(declared[name], types), value, f"{place}, {name}") for name, value in values.items()}


def complete(parameters: Sequence[Parameter], values: Mapping[str, object], types: Types) -> dict[str, object]:
    """Return values with those that are missing as an empty message has them; a message's fields are not known here."""
    empty: dict[str, object] = {}
    for parameter in parameters:
        ros = _ros_type(parameter, types)
        if ros.array:
            empty[parameter.name] = []
        elif not ros.package and ros.name in PRIMITIVES:
            empty[parameter.name] = _EMPTY[PRIMITIVES[ros.name]]
        else:
            empty[parameter.name] = SimpleNamespace()
    return {**empty, **values}


_EMPTY: Mapping[str, object] = {"bool": False, "int": 0, "float": 0.0, "str": ""}


def _ros_type(parameter: Parameter, types: Types) -> RosType:
    return types.get(parameter.type) or RosType("", parameter.type)


def _fitting(ros: RosType, value: Any, place: str) -> object:
    if ros.array:
        if isinstance(value, str | bytes) or not hasattr(value, "__iter__"):
            raise ValueError(f"{place} takes a list ({ros.interface}), not {value!r}")
        element = RosType(ros.package, ros.name)
        return [_fitting(element, part, f"{place}[{index}]") for index, part in enumerate(value)]
    kind = PRIMITIVES.get(ros.name) if not ros.package else None
    return _namespaces(value) if kind is None else _SCALARS[kind](ros.name, value, place)


def _namespaces(value: Any) -> object:
    """Return a deep copy with a namespace for each mapping, and for a vector of three numbers."""
    if isinstance(value, Mapping):
        return SimpleNamespace(**{str(name): _namespaces(part) for name, part in value.items()})
    if isinstance(value, list | tuple) and len(value) == len(_VECTOR) and all(_is_number(part) for part in value):
        return SimpleNamespace(**{name: float(part) for name, part in zip(_VECTOR, value, strict=True)})
    return copy.deepcopy(value)


def _is_number(value: Any) -> bool:
    return hasattr(value, "__float__") and not isinstance(value, bool) and not getattr(value, "shape", ())


def _float(kind: str, value: Any, place: str) -> float:
    if not _is_number(value):
        raise ValueError(f"{place} takes a number ({kind}), not {value!r}")
    return float(value)


def _integer(kind: str, value: Any, place: str) -> int:
    bits = int(kind.removeprefix("u").removeprefix("int"))
    low, high = (0, 2**bits - 1) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    number = _float(kind, value, place)
    if not number.is_integer() or not low <= number <= high:
        raise ValueError(f"{place} takes a whole number from {low} to {high} ({kind}), not {value!r}")
    return int(value)


def _of_type(wanted: type) -> Callable[[str, Any, str], object]:
    def check(kind: str, value: Any, place: str) -> object:
        if isinstance(value, wanted):
            return value
        raise ValueError(f"{place} takes a {kind}, not {value!r}")

    return check


_SCALARS: Mapping[str, Callable[[str, Any, str], object]] = {
    "bool": _of_type(bool),
    "int": _integer,
    "float": _float,
    "str": _of_type(str),
}
