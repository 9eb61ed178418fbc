"""Small formulas of behaviour files: ``distance(position, target) / speed + uniform(0, 1)``.

Python's arithmetic, comparisons, ``and``, ``or``, ``not``, ``a if b else c``, fields and elements; nothing else. Names are the
inputs of the skill, the mock's memory, and what the place offers (``t``, ``f``, ``delay``).

Not ``simpleeval``: it finds what is not allowed, and names that are not known, when it evaluates a formula. A file of behaviour is
refused when it is read, with its line; a formula in a branch that a run does not take counts, too.
"""

from __future__ import annotations

import ast
import math
import random
from collections.abc import Callable, Mapping, Sequence
from types import CodeType
from typing import Any

from alula.runtime.core.errors import SkillRuntimeError

Names = Mapping[str, object]
_NODES = (
    ast.Expression,
    ast.BinOp,
    ast.UnaryOp,
    ast.BoolOp,
    ast.Compare,
    ast.IfExp,
    ast.Call,
    ast.Attribute,
    ast.Subscript,
    ast.Name,
    ast.Constant,
    ast.List,
    ast.Tuple,
    ast.expr_context,
    ast.Add,
    ast.Sub,
    ast.Mult,
    ast.Div,
    ast.Mod,
    ast.unaryop,
    ast.boolop,
    ast.cmpop,
)


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
    """An expression that was checked; raise FormulaError when the text is none."""

    def __init__(self, text: str) -> None:
        self.text = text
        try:
            tree = ast.parse(text.strip(), mode="eval")
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise FormulaError(f"`{text}` is no formula: {getattr(error, 'msg', error)}") from None
        self.names = _names(tree, text)
        self._code: CodeType = compile(tree, "<formula>", "eval")

    def __call__(self, names: Names, source: random.Random) -> object:
        """Return the value; raise FormulaError when there is none."""
        scope = {"__builtins__": {}, **FUNCTIONS, **_drawing(source), **names}
        try:
            return eval(self._code, scope)  # noqa: S307 - of the few kinds of nodes that were let through
        except Exception as error:
            raise FormulaError(f"`{self.text}` has no value: {type(error).__name__}: {error}") from error

    def __repr__(self) -> str:
        return f"Formula({self.text!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Formula) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)


def _names(tree: ast.Expression, text: str) -> frozenset[str]:
    """Return the names that a formula needs; raise FormulaError for anything that is not let through."""
    called: set[ast.expr] = set()
    names: set[str] = set()
    for node in ast.walk(tree):
        if not isinstance(node, _NODES):
            raise FormulaError(f"`{text}`: {type(node).__name__} is not allowed in formulas")
        if isinstance(node, ast.Attribute) and node.attr.startswith("_"):
            raise FormulaError(f"`{text}`: the field {node.attr} is not allowed in formulas")
        if isinstance(node, ast.Call):
            if not isinstance(node.func, ast.Name) or node.func.id not in {*FUNCTIONS, *DRAWS} or node.keywords:
                known = ", ".join((*FUNCTIONS, *DRAWS))
                raise FormulaError(f"`{text}`: there is no function {ast.unparse(node.func)}; there are {known}")
            called.add(node.func)
        if isinstance(node, ast.Name) and node not in called:
            names.add(node.id)
    return frozenset(names)
