"""The inputs of a skill as text fields: what stands in them at first, and the values that they mean; no ROS, no screen."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from alula.model.model import Parameter, Skill
from alula.model.units import KIND_OF_UNIT

FLOATS = ("float64", "float32")
UNIT_OF_NAME: Mapping[str, str] = {
    **dict.fromkeys(("height", "altitude", "distance", "length", "radius"), "m"),
    **dict.fromkeys(("speed", "velocity"), "m/s"),
    **dict.fromkeys(("heading", "yaw", "angle"), "rad"),
    **dict.fromkeys(("yaw_rate",), "rad/s"),
    **dict.fromkeys(("duration", "timeout"), "s"),
}
"""The unit of an input whose comment names none, as of the paper's takeoff: messages carry SI units (REP 103)."""
TRUE, FALSE = ("true", "yes", "1", "on"), ("false", "no", "0", "off")


class FormError(ValueError):
    """A field does not hold what its input takes; the message names the input."""


@dataclass(frozen=True)
class Field:
    """One input: ``kind`` as ROS names it (``float64``, ``geometry_msgs/Point``), ``said`` its unit and the model's comment."""

    name: str
    kind: str
    said: str
    text: str

    @property
    def label(self) -> str:
        """Name, type, unit and comment."""
        return f"{self.name} ({self.kind}{f', {self.said}' if self.said else ''})"


def fields(skill: Skill, kinds: Mapping[str, str], remembered: Mapping[str, str]) -> list[Field]:
    """Return the fields of a skill's inputs; ``kinds`` are those of its goal, ``remembered`` the texts of the last time."""
    said = {parameter.name: parameter for parameter in skill.inputs}
    made = []
    for name, kind in kinds.items():
        parameter = said.get(name)
        text = remembered.get(name) or (parameter.default if parameter and parameter.default else default_text(kind))
        made.append(Field(name, kind, _said(parameter, kind) if parameter else "", text))
    return made


def _said(parameter: Parameter, kind: str) -> str:
    """Return the comment, with the unit from the name in front of it where the comment begins with none."""
    unit = UNIT_OF_NAME.get(parameter.name, "") if kind in FLOATS else ""
    first = re.split(r"[,;:]", parameter.comment, maxsplit=1)[0].strip()
    told = first in KIND_OF_UNIT or first in UNIT_OF_NAME.values()
    return parameter.comment if told else ", ".join(part for part in (unit, parameter.comment) if part)


def default_text(kind: str) -> str:
    """Return what a field of a kind holds when nothing better is known."""
    if kind in FLOATS:
        return "0.0"
    if kind.startswith(("int", "uint")) and "[" not in kind:
        return "0"
    if kind == "bool":
        return "false"
    if kind == "string":
        return ""
    if "[" in kind:
        return "[]"
    return "0, 0, 0" if kind.endswith(("/Point", "/Vector3", "/Point32")) else "{}"


def values(made: Sequence[Field], texts: Mapping[str, str]) -> dict[str, object]:
    """Return the inputs that the texts of the fields stand for; raise FormError naming the first invalid one."""
    return {field.name: value_of(field, texts[field.name].strip()) for field in made}


def value_of(field: Field, text: str) -> object:
    """Return the value of one field's text.

    Messages are written as YAML (``{x: 1, y: 2, z: 3}``), those with x, y and z also as three numbers.
    """
    if field.kind == "string":
        return text
    if field.kind == "bool":
        return _truth(field, text)
    if field.kind in FLOATS:
        return _number(field, text, float)
    if field.kind.startswith(("int", "uint")) and "[" not in field.kind:
        return _number(field, text, int)
    return _structure(field, text)


def _truth(field: Field, text: str) -> bool:
    if text.lower() in TRUE:
        return True
    if text.lower() in FALSE:
        return False
    raise FormError(f"{field.name}: write true or false, not {text!r}")


def _number(field: Field, text: str, kind: type[float | int]) -> float:
    try:
        return kind(text)
    except ValueError:
        raise FormError(f"{field.name}: {text!r} is no {'whole number' if kind is int else 'number'}") from None


def _structure(field: Field, text: str) -> Any:
    is_list = text[:1] in {"[", "{"} or "," not in text
    try:
        value = yaml.safe_load(text if is_list else f"[{text}]")
    except yaml.YAMLError:
        value = None
    if isinstance(value, dict | list):
        return value
    example = "1, 2, 3" if default_text(field.kind) == "0, 0, 0" else "[1, 2]" if "[" in default_text(field.kind) else "{field: value}"
    raise FormError(f"{field.name}: {text!r} is no {field.kind}; write it as {example}")
