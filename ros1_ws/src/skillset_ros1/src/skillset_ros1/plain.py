"""ROS 1 messages as what ``json`` can write, in the very form that their ROS 2 twins have."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import genpy

from skill_runtime import plain
from skillset_ros1.convert import fields_of


def to_plain(value: Any) -> Any:
    """Return what ``json`` can write; times as ``sec`` and ``nanosec``, headers without the ``seq`` that ROS 2 has not."""
    return plain.to_plain(_without_messages(value))


def _without_messages(value: Any) -> Any:
    """Return the value with every message in it as a dict by field."""
    if isinstance(value, genpy.Message):
        fields = fields_of(value)
        if type(value)._type == "std_msgs/Header":  # noqa: SLF001 - genpy's way to tell
            fields.pop("seq")
        return {name: _field(kind, getattr(value, name)) for name, kind in fields.items()}
    if isinstance(value, genpy.TVal):
        return {"sec": value.secs, "nanosec": value.nsecs}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _without_messages(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, SimpleNamespace):
        return _without_messages(vars(value))
    if isinstance(value, Mapping):
        return {str(name): _without_messages(part) for name, part in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [_without_messages(part) for part in value]
    return value


def _field(kind: str, value: Any) -> Any:
    """Return a field's value; genpy leaves an integer or 0/1 where a float or a truth value belongs."""
    if kind == "bool":
        return bool(value)
    if kind in {"float32", "float64"}:
        return float(value)
    return _without_messages(value)
