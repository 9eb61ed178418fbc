"""Small formulas of behaviour files: ``distance(position, target) / speed + uniform(0, 1)``.

The skill language's conditions between terms with arithmetic (``terms``); nothing else. Names are the inputs of the skill, the mock's
memory, and what the place offers (``t``, ``f``, ``delay``).
"""

from __future__ import annotations

import math
import operator
import random
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from alula.language.lexer import Source
from alula.mock.terms import Names, read_terms
from alula.runtime.core.errors import SkillRuntimeError

_COMMENT = re.compile(r"\"(?:[^\"\\]|\\.)*\"|'(?:[^'\\]|\\.)*'|(?P<comment>//|/\*)", re.DOTALL)
"""Strings, and outside of them what begins a comment."""
NO_RESOURCES: Mapping[str, Sequence[str]] = {}


class FormulaError(SkillRuntimeError):
    """A formula can't be read or evaluated; the message names it and what is wrong."""


def coordinates(point: Any) -> tuple[float, ...]:
    """Return the numbers of a point that is a sequence or has x, y and z (x, y)."""
    if isinstance(point, Sequence) and not isinstance(point, str):
        return tuple(float(part) for part in point)
    return tuple(float(getattr(point, name)) for name in ("x", "y", "z") if hasattr(point, name))


def distance(one: Any, other: Any) -> float:
    """Return how far apart two points, or two numbers, are."""
    if isinstance(one, int | float) and isinstance(other, int | float):
        return abs(one - other)
    return math.dist(coordinates(one), coordinates(other))


def angle(one_rad: float, other_rad: float) -> float:
    """Return by how much two headings differ, 0 to pi."""
    return abs(math.remainder(one_rad - other_rad, math.tau))


FUNCTIONS: Mapping[str, Callable[..., object]] = {
    "distance": distance,
    "angle": angle,
    "mod": operator.mod,
    "abs": abs,
    "min": min,
    "max": max,
    "sqrt": math.sqrt,
    "hypot": math.hypot,
    "atan2": math.atan2,
    "sin": math.sin,
    "cos": math.cos,
}
DRAWS = ("uniform", "normal", "exponential", "chance")
"""Drawn again at each evaluation: between two numbers; by mean and deviation; by mean; true with a probability."""


def _drawing(source: random.Random) -> dict[str, Callable[..., object]]:
    return {
        "uniform": source.uniform,
        "normal": source.gauss,
        "exponential": lambda mean: source.expovariate(1.0 / mean),
        "chance": lambda probability: source.random() < probability,
    }


class Formula:
    """An expression that was checked.

    Args:
        text: as the file has it.
        resources: those that it may ask for, ``link == UP``, with their states.

    Raises:
        FormulaError: the text is no formula; the message says what was expected where.
    """

    def __init__(self, text: str, resources: Mapping[str, Sequence[str]] = NO_RESOURCES) -> None:
        self.text = text
        if any(match["comment"] for match in _COMMENT.finditer(text)):
            raise FormulaError(f"`{text}`: `//` and `/*` begin comments, which a formula doesn't have; a division is written `a / b`")
        source = Source("", " ".join(text.splitlines()), ends="the end of the formula")
        term, self.names = read_terms(source, (*FUNCTIONS, *DRAWS), resources)
        if source.diagnostics or term is None:
            first = source.diagnostics[0]
            hint = f"; {first.hint}" if first.hint else ""
            raise FormulaError(f"`{text}`: {first.message} (character {first.span.column}){hint}")
        self._term = term

    def __call__(self, names: Names, source: random.Random) -> object:
        """Return the value; raise FormulaError when there is none."""
        try:
            return self._term(names, {**FUNCTIONS, **_drawing(source)})
        except Exception as error:
            raise FormulaError(f"`{self.text}` has no value: {type(error).__name__}: {error}") from error

    def __repr__(self) -> str:
        return f"Formula({self.text!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Formula) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)
