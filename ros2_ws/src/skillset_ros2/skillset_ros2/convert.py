"""Fields of ROS 2 messages."""

from __future__ import annotations

import importlib
import re
from typing import Any

from alula.model.ros_types import INTEGER_RANGES
from alula.runtime.field_types import FieldTypes

_ARRAY = re.compile(r"^sequence<(.*?)(, \d+)?>$|\[.*\]$")


def fields_of(message: Any) -> dict[str, str]:
    """Return a message's (or its class's) fields with their types: ``{"height": "double", "target": "geometry_msgs/Point"}``."""
    fields: dict[str, str] = message.get_fields_and_field_types()
    return fields


def _element_of(kind: str) -> str:
    return _ARRAY.sub(r"\1", kind) if _ARRAY.search(kind) else ""


def message_class(type_name: str) -> Any:
    """Return the class of ``geometry_msgs/Point`` or ``geometry_msgs/msg/Point``; raise ImportError or AttributeError."""
    package, name = type_name.split("/", maxsplit=1)[0], type_name.rsplit("/", maxsplit=1)[-1]
    return getattr(importlib.import_module(f"{package}.msg"), name)


TYPES = FieldTypes(
    fields_of, message_class, _element_of, floats={"double", "float"}, integers=INTEGER_RANGES, classes={"boolean": bool, "string": str}
)
fill = TYPES.fill
values_of = TYPES.values_of

_PLAIN_NAMES = {"double": "float64", "float": "float32", "boolean": "bool"}


def ros_types(message: Any) -> dict[str, str]:
    """Return a message's fields with their types as interface files have them: ``float64``, ``geometry_msgs/Point[]``."""
    return {name: _interface_type(kind) for name, kind in fields_of(message).items()}


def _interface_type(kind: str) -> str:
    if element := _element_of(kind):
        return f"{_interface_type(element)}[]"
    return _PLAIN_NAMES.get(kind, kind)
