"""Values of either ROS world as what ``json`` can write."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any


def to_plain(value: Any) -> Any:
    """Return what ``json`` can write: messages, dataclasses and namespaces become dicts, NaN and infinities null."""
    if isinstance(value, bool | int | str) or value is None:
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if hasattr(value, "get_fields_and_field_types"):
        return {name: to_plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if hasattr(value, "_md5sum"):
        return _plain_ros1(value)
    if hasattr(value, "to_nsec"):
        return {"sec": value.secs, "nanosec": value.nsecs}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, SimpleNamespace):
        return to_plain(vars(value))
    if isinstance(value, Mapping):
        return {str(name): to_plain(part) for name, part in value.items()}
    if hasattr(value, "tolist"):
        return to_plain(value.tolist())
    if isinstance(value, bytes | bytearray):
        return list(value)
    if isinstance(value, Sequence | set):
        return [to_plain(part) for part in value]
    return str(value)


_ROS1_KINDS = {"bool": bool, "float32": float, "float64": float}


def _plain_ros1(message: Any) -> dict[str, Any]:
    """Return a message of ROS 1 as its ROS 2 twin: truth values and floats as such, headers without their ``seq``."""
    fields = dict(zip(message.__slots__, message._slot_types, strict=True))  # noqa: SLF001 - genpy's way to tell
    if message._type == "std_msgs/Header":  # noqa: SLF001
        del fields["seq"]
    return {name: to_plain(_ROS1_KINDS.get(kind, _same)(getattr(message, name))) for name, kind in fields.items()}


def _same(value: Any) -> Any:
    return value
