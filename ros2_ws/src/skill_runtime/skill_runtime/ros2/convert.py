"""Fields of ROS 2 messages, and inputs of skills as plain values."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from skill_runtime.fitting import INTEGERS
from skill_runtime.plain import FieldTypes, to_plain

if TYPE_CHECKING:
    from skill_runtime.hooks import SkillHooks

_ARRAY = re.compile(r"^sequence<(.*?)(, \d+)?>$|\[.*\]$")


def fields_of(message: Any) -> dict[str, str]:
    """Return a message's (or its class's) fields with their types: ``{"height": "double", "target": "geometry_msgs/Point"}``."""
    fields: dict[str, str] = message.get_fields_and_field_types()
    return fields


def _element_of(kind: str) -> str:
    return _ARRAY.sub(r"\1", kind) if _ARRAY.search(kind) else ""


_TYPES = FieldTypes(fields_of, _element_of, floats={"double", "float"}, integers=INTEGERS, classes={"boolean": bool, "string": str})
fill = _TYPES.fill
values_of = _TYPES.values_of


def values_from_json(action: Any, skill: str, inputs_json: str) -> dict[str, object]:
    """Return a skill's inputs as plain values; raise ValueError where the JSON is no object of inputs that fit the goal."""
    values = json.loads(inputs_json)
    if not isinstance(values, dict):
        raise ValueError(f"inputs of {skill} are a JSON object, not {inputs_json}")  # noqa: TRY004 - as for every other misfit
    plain: dict[str, object] = to_plain(fill(action.Goal(), values, f"inputs of {skill}"))
    return plain


def inputs_from_values(hooks: SkillHooks, action: Any, skill: str, values: Mapping[str, object]) -> object:
    """Make what hooks get from plain values of the inputs; raise ValueError where they don't fit."""
    return hooks.make_inputs(values_of(fill(action.Goal(), values, f"inputs of {skill}")))
