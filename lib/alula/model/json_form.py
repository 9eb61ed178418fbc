"""The model as JSON and back, without loss: what `describe` serves, what generated code carries.

An object has the fields of its class; conditions, which may be of several classes, carry it as ``"is"``. Places in the
source are left out: they mean nothing to the reader of the JSON. The decoder is driven by the classes' own annotations,
so that a field that is added to the model is in the JSON at once.
"""

from __future__ import annotations

import json
import math
import types
import typing
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from functools import cache, lru_cache
from typing import Any

from alula.model import model
from alula.model.errors import ModelFormatError
from alula.model.expressions import And, Constant, DataIs, Expression, Implies, Not, Or, ResourceIs, SkillRuns
from alula.model.model import Skillset

_CONDITIONS: dict[str, type] = {
    "resource": ResourceIs,
    "data": DataIs,
    "running": SkillRuns,
    "constant": Constant,
    "not": Not,
    "and": And,
    "or": Or,
    "implies": Implies,
}
_TAGS = {cls: tag for tag, cls in _CONDITIONS.items()}
_MAX_DEPTH = 100


def to_json(skillset: Skillset, *, indent: int | None = None) -> str:
    """Return the model as a JSON object in ASCII; ``indent`` as in ``json.dumps``."""
    return json.dumps(_encode(skillset), indent=indent, allow_nan=False)


@lru_cache(maxsize=32)
def from_json(text: str) -> Skillset:
    """Return the model that ``to_json`` wrote, the same one for the same text; raise ModelFormatError naming the place when it is none."""
    try:
        value = json.loads(text)
        return typing.cast("Skillset", _decode(value, Skillset, "skillset", 0))
    except (_NoModelError, ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise ModelFormatError(f"this JSON is no skillset: {reason}") from error


class _NoModelError(Exception):
    """The value at a place doesn't fit the model."""

    def __init__(self, where: str, wanted: str, value: object) -> None:
        shown = repr(value)
        super().__init__(f"{where} should be {wanted}, not {shown if len(shown) < 60 else shown[:57] + '...'}")


def _encode(value: object) -> object:
    match value:
        case Enum():
            return value.value
        case tuple():
            return [_encode(item) for item in value]
        case str() | bool() | int() | float() | None:
            return value
        case _ if is_dataclass(value) and not isinstance(value, type):
            tag = _TAGS.get(type(value))
            body = {f.name: _encode(getattr(value, f.name)) for f in fields(value) if f.name != "span"}
            return {"is": tag, **body} if tag else body
        case _:
            raise TypeError(f"{type(value).__name__} has no JSON form")


def _decode(value: object, wanted: Any, where: str, depth: int) -> object:
    """Return ``value`` as an instance of the annotation ``wanted``."""
    if depth > _MAX_DEPTH:
        raise _NoModelError(where, "nested less deeply", value)
    if wanted == Expression:
        return _decode_condition(value, where, depth)
    origin = typing.get_origin(wanted)
    if origin is tuple:
        if not isinstance(value, list):
            raise _NoModelError(where, "a list", value)
        item = typing.get_args(wanted)[0]
        return tuple(_decode(v, item, f"{where}[{i}]", depth + 1) for i, v in enumerate(value))
    if origin is types.UnionType:
        return _decode_union(value, typing.get_args(wanted), where, depth)
    if isinstance(wanted, type) and issubclass(wanted, Enum):
        return _decode_enum(value, wanted, where)
    if is_dataclass(wanted):
        return _decode_object(value, typing.cast("type", wanted), where, depth)
    return _decode_plain(value, typing.cast("type", wanted), where)


def _decode_plain(value: object, wanted: type, where: str) -> object:
    if wanted is float and type(value) in {int, float}:
        number = float(typing.cast("float", value))
        if math.isfinite(number):
            return number
    elif type(value) is wanted:
        return value
    raise _NoModelError(where, wanted.__name__, value)


def _decode_union(value: object, options: tuple[Any, ...], where: str, depth: int) -> object:
    if value is None and types.NoneType in options:
        return None
    if set(typing.get_args(Expression)) <= set(options):
        return _decode_condition(value, where, depth)
    for option in options:
        # A truth value is an int to Python, but not to the model: exact types decide.
        if option is type(value) or (option is float and type(value) is int):
            return _decode_plain(value, option, where)
        if is_dataclass(option) and isinstance(value, dict):
            return _decode(value, option, where, depth)
    raise _NoModelError(where, " or ".join(getattr(o, "__name__", str(o)) for o in options), value)


def _decode_enum(value: object, wanted: type[Enum], where: str) -> Enum:
    for member in wanted:
        if member.value == value:
            return member
    raise _NoModelError(where, f"one of {', '.join(str(m.value) for m in wanted)}", value)


def _decode_condition(value: object, where: str, depth: int) -> object:
    tag = value.get("is") if isinstance(value, dict) else None
    if not isinstance(value, dict) or not isinstance(tag, str) or tag not in _CONDITIONS:
        raise _NoModelError(where, f'a condition with "is" one of {", ".join(_CONDITIONS)}', value)
    return _decode_object({k: v for k, v in value.items() if k != "is"}, _CONDITIONS[tag], where, depth)


def _decode_object(value: object, cls: type, where: str, depth: int) -> object:
    if not isinstance(value, dict):
        raise _NoModelError(where, "an object", value)
    known = {f.name: f for f in fields(cls) if f.name != "span"}
    if unknown := set(value) - set(known):
        raise _NoModelError(where, f"an object with the fields {', '.join(known)}", sorted(unknown))
    arguments = {}
    for name, declared in known.items():
        if name in value:
            arguments[name] = _decode(value[name], _annotations(cls)[name], f"{where}.{name}", depth + 1)
        elif declared.default is MISSING and declared.default_factory is MISSING:
            raise _NoModelError(where, f"an object with `{name}`", sorted(value))
    return cls(**arguments)


@cache
def _annotations(cls: type) -> dict[str, Any]:
    return typing.get_type_hints(cls, localns=vars(model))  # where a public class is defined, not where users import it from
