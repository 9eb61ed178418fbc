"""Sanitize what hooks hand over, for every middleware: UTF-8 texts of bounded length without zeros, outputs of their types."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from alula.common.plain import to_plain
from alula.model.model import Skill
from alula.model.ros_types import PRIMITIVES
from alula.runtime import fitting

TEXT_LIMIT = 10_000
"""Characters of a text that are carried; the rest is counted."""
LINE_LIMIT = 500
VALUE_LIMIT = 100


def as_text(value: object, limit: int = TEXT_LIMIT) -> str:
    """Return a value as a text that every middleware carries, whatever it is; half characters and zeros become escapes."""
    try:
        words = str.encode(value if isinstance(value, str) else str(value), "utf-8", "backslashreplace").decode()
    except BaseException:  # noqa: BLE001 - whatever a hook's object does when it is printed
        words = f"a value of type {type(value).__name__}"
    words = words.replace("\0", "\\x00")
    return words if len(words) <= limit else f"{words[:limit]}... ({len(words) - limit} characters more)"


def as_short_text(value: object) -> str:
    """Return a value as it is written in Python, in a few words, for an error."""
    try:
        return as_text(repr(value), VALUE_LIMIT)
    except BaseException:  # noqa: BLE001 - as above
        return f"a value of type {type(value).__name__}"


def error_line(error: BaseException) -> str:
    """Return the type and message of an exception, in one line."""
    said = "; ".join(line.strip() for line in as_text(error, LINE_LIMIT).splitlines() if line.strip())
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def fitted_outputs(skill: Skill, outputs: Mapping[str, object]) -> dict[str, object]:
    """Return outputs as their types hold them; a message's fields are checked by the middleware that knows the message.

    Raises:
        ValueError: a name or a value does not fit; the message names the skill and the output.
    """
    types = {output.name: output.type for output in skill.outputs}
    unknown = [as_text(name) for name in outputs if name not in types]
    if unknown:
        raise ValueError(f"skill {skill.name} has no output {', '.join(unknown)}; it has {', '.join(types) or 'none'}")
    return {name: _fitted(types[name], value, f"outputs of {skill.name}, {name}") for name, value in outputs.items()}


def _fitted(kind: str, value: object, place: str) -> object:
    try:
        if kind in PRIMITIVES:
            fitted = fitting.primitive(kind, value, place)
            return as_text(fitted) if isinstance(fitted, str) else fitted
        json.dumps(to_plain(value))
    except ValueError:
        raise
    except BaseException as error:
        raise ValueError(f"{place} takes a {kind}, not {as_short_text(value)}") from error
    return value


# --- what hooks return --------------------------------------------------------------------------------------------------


def fitted_return(hook: str, value: object) -> object:
    """Return what a hook has returned as its type: a text, a number, False or None.

    Raises:
        ValueError: it is none of what the hook may return.
    """
    expected, fit = _RETURNS.get(hook, ("", _nothing))
    try:
        return fit(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{hook} returned {as_short_text(value)}; it has to return {expected}") from error


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError
    return as_text(value)


def _answer(value: object) -> str:
    return "" if value is None else _text(value)


def _progress(value: Any) -> float:
    """Return a progress, held within 0 to 1."""
    if not fitting.is_number(value) or not math.isfinite(value):
        raise ValueError
    return min(1.0, max(0.0, float(value)))


def _stopped(value: object) -> object:
    """Return False where the stop is only under way."""
    return False if value is False else None


def _nothing(_: object) -> None:
    """Drop what is not asked for."""


_RETURNS: Mapping[str, tuple[str, Callable[[Any], object]]] = {
    "validate": ('a text, "" to accept the request', _text),
    "progress": ("a number from 0 to 1", _progress),
    "on_pause": ('why it can\'t, or ""', _answer),
    "on_resume": ('why it can\'t, or ""', _answer),
    "on_interrupt": ("False or nothing", _stopped),
}
