"""Between ROS messages and plain values."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from skill_runtime.hooks import SkillHooks

_FLOATS = {"double", "float"}
_VECTOR_FIELDS = ["x", "y", "z"]


def message_class(type_name: str) -> Any:
    """Return the class of ``geometry_msgs/Point`` or ``geometry_msgs/msg/Point``; raise ImportError or AttributeError."""
    package, name = type_name.split("/", maxsplit=1)[0], type_name.rsplit("/", maxsplit=1)[-1]
    return getattr(importlib.import_module(f"{package}.msg"), name)


def fields_of(message: Any) -> dict[str, str]:
    """Return a message's (or its class's) fields with their types: ``{"height": "double", "target": "geometry_msgs/Point"}``."""
    fields: dict[str, str] = message.get_fields_and_field_types()
    return fields


def values_of(message: Any) -> dict[str, object]:
    """Return the values of a message's fields by name, not taken apart any further."""
    return {name: getattr(message, name) for name in fields_of(message)}


def fill(message: Any, values: Mapping[str, object], place: str) -> Any:
    """Set the named fields of a message from plain values; return it.

    Numbers fit every numeric field that can hold them, a message or mapping fits a message, a sequence of three numbers
    fits a message with x, y and z.

    Raises:
        ValueError: a name or a value does not fit; the message names ``place`` and the field.
    """
    fields = fields_of(message)
    for name, value in values.items():
        if name not in fields:
            raise ValueError(f"{place} has no {name!r}; it has {', '.join(fields) or 'none'}")
        setattr(message, name, _fitting(fields[name], value, f"{place}, {name}"))
    return message


def _fitting(kind: str, value: Any, place: str) -> Any:
    """Return the value as the field's Python type."""
    if kind in _FLOATS:
        return float(_number(value, kind, place))
    if kind.startswith(("int", "uint")) and "[" not in kind:
        return _integer(kind, value, place)
    if kind == "boolean":
        return _of_type(bool, kind, value, place)
    if kind == "string":
        return _of_type(str, kind, value, place)
    if kind.startswith("sequence<") or "[" in kind:
        return _elements(kind, value, place)
    return _message(kind, value, place)


def _number(value: Any, kind: str, place: str) -> Any:
    if isinstance(value, bool) or not hasattr(value, "__float__") or (hasattr(value, "shape") and value.shape):
        raise ValueError(f"{place} takes a number ({kind}), not {value!r}")
    return value


def _integer(kind: str, value: Any, place: str) -> int:
    bits = int(kind.removeprefix("u").removeprefix("int"))
    low, high = (0, 2**bits - 1) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    number = _number(value, kind, place)
    if int(number) != number or not low <= number <= high:
        raise ValueError(f"{place} takes a whole number from {low} to {high} ({kind}), not {value!r}")
    return int(number)


def _of_type(wanted: type, kind: str, value: Any, place: str) -> Any:
    if isinstance(value, wanted):
        return value
    raise ValueError(f"{place} takes a {kind}, not {value!r}")


def _elements(kind: str, value: Any, place: str) -> list[Any]:
    inner = re.sub(r"^sequence<(.*?)(, \d+)?>$|\[.*\]$", r"\1", kind)
    if isinstance(value, str | bytes) or not hasattr(value, "__iter__"):
        raise ValueError(f"{place} takes a list ({kind}), not {value!r}")
    return [_fitting(inner, element, f"{place}[{index}]") for index, element in enumerate(value)]


def _message(kind: str, value: Any, place: str) -> Any:
    wanted = message_class(kind)
    if isinstance(value, wanted):
        return value
    if isinstance(value, Mapping):
        return fill(wanted(), value, place)
    vector = list(fields_of(wanted)) == _VECTOR_FIELDS
    if vector and not isinstance(value, str) and hasattr(value, "__len__") and len(value) == len(_VECTOR_FIELDS):
        return fill(wanted(), dict(zip(_VECTOR_FIELDS, value, strict=True)), place)
    raise ValueError(f"{place} takes a {kind}{' or three numbers' if vector else ''}, not {value!r}")


def inputs_from_json(hooks: SkillHooks, action: Any, skill: str, inputs_json: str) -> object:
    """Make a skill's inputs from a JSON object of them; raise ValueError where it is none or does not fit the goal."""
    values = json.loads(inputs_json)
    if not isinstance(values, dict):
        raise ValueError(f"inputs of {skill} are a JSON object, not {inputs_json}")  # noqa: TRY004 - as for every other misfit
    return hooks.make_inputs(values_of(fill(action.Goal(), values, f"inputs of {skill}")))
