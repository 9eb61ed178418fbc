"""Fields of ROS 1 messages; what fits into them is as in ROS 2 (``alula.runtime.field_types``)."""

from __future__ import annotations

import importlib
import re
from typing import Any

import genpy

from alula.model.ros_types import INTEGER_RANGES
from alula.runtime.field_types import FieldTypes

_ARRAY = re.compile(r"\[\d*\]$")


def fields_of(message: Any) -> dict[str, str]:
    """Return a message's (or its class's) fields with their types: ``{"height": "float64", "target": "geometry_msgs/Point"}``."""
    return dict(zip(message.__slots__, message._slot_types, strict=True))  # noqa: SLF001 - genpy's way to tell


def _element_of(kind: str) -> str:
    return _ARRAY.sub("", kind) if _ARRAY.search(kind) else ""


def message_class(type_name: str) -> Any:
    """Return the class of ``geometry_msgs/Point`` or ``geometry_msgs/msg/Point``; raise ImportError or AttributeError."""
    package, name = type_name.split("/", maxsplit=1)[0], type_name.rsplit("/", maxsplit=1)[-1]
    return getattr(importlib.import_module(f"{package}.msg"), name)


TYPES = FieldTypes(
    fields_of,
    message_class,
    _element_of,
    floats={"float32", "float64"},
    integers={**INTEGER_RANGES, "byte": INTEGER_RANGES["uint8"], "char": INTEGER_RANGES["uint8"]},
    classes={"bool": bool, "string": str},
    times={"time": genpy.Time, "duration": genpy.Duration},
    no_lists=(str,),  # genpy gives uint8[] as bytes
)
fill = TYPES.fill
values_of = TYPES.values_of
