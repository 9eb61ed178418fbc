"""Inputs and outputs without message classes: checked like a message's fields, handed over as copies."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

from alula.model.model import Parameter
from alula.model.ros_types import PRIMITIVES, RosType
from alula.runtime import fitting

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
        fitting.check_name(name, declared, place)
    return {name: _fitting(ros_type(declared[name], types), value, f"{place}, {name}") for name, value in values.items()}


def complete(parameters: Sequence[Parameter], values: Mapping[str, object], types: Types) -> dict[str, object]:
    """Return values with those that are missing as an empty message has them; a message's fields are not known here."""
    empty: dict[str, object] = {}
    for parameter in parameters:
        ros = ros_type(parameter, types)
        if ros.array:
            empty[parameter.name] = []
        elif not ros.package and ros.name in PRIMITIVES:
            empty[parameter.name] = _EMPTY[PRIMITIVES[ros.name]]
        else:
            empty[parameter.name] = SimpleNamespace()
    return {**empty, **values}


_EMPTY: Mapping[str, object] = {"bool": False, "int": 0, "float": 0.0, "str": ""}


def ros_type(parameter: Parameter, types: Types) -> RosType:
    """Return what a parameter's type is in ROS."""
    return types.get(parameter.type) or RosType("", parameter.type)


def _fitting(ros: RosType, value: Any, place: str) -> object:
    if ros.array:
        element = RosType(ros.package, ros.name)
        return [_fitting(element, part, where) for where, part in fitting.elements(value, ros.interface, place)]
    is_primitive = not ros.package and ros.name in PRIMITIVES
    return fitting.primitive(ros.name, value, place) if is_primitive else _namespaces(value)


def _namespaces(value: Any) -> object:
    """Return a deep copy with a namespace for each mapping, and for a vector of three numbers."""
    if isinstance(value, Mapping):
        return SimpleNamespace(**{str(name): _namespaces(part) for name, part in value.items()})
    if isinstance(value, list | tuple) and len(value) == len(_VECTOR) and all(fitting.is_number(part) for part in value):
        return SimpleNamespace(**{name: float(part) for name, part in zip(_VECTOR, value, strict=True)})
    return copy.deepcopy(value)
