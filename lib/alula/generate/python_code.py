"""Small things that all generated Python needs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from alula.generate.text import lines, packages
from alula.language.robot import Robot
from alula.model.model import Parameter

WIDTH = 140
"""Longest line of generated code, the formatter's setting of this tree."""


def wrapped(before: str, items: Sequence[str], after: str, *, indent: int, brackets: str = "()") -> str:
    """Return `before(items)after` on one line, or, as the formatter would, an item a line."""
    margin = " " * indent
    one = f"{margin}{before}{brackets[0]}{', '.join(items)}{brackets[1]}{after}"
    if len(one) <= WIDTH:
        return one
    # A bare `*` has no comma-less form of its own: it is an item like any other.
    return f"{margin}{before}{brackets[0]}\n" + lines((f"{item}," for item in items), indent + 4) + f"\n{margin}{brackets[1]}{after}"


def keyword_only(parameters: Sequence[str]) -> list[str]:
    """Return parameters of a function that are given by name only."""
    return ["*", *parameters] if parameters else []


def annotation(robot: Robot, parameter: Parameter) -> str:
    """Return a parameter's type in Python."""
    return robot.ros_type(parameter.type).python


def message_imports(robot: Robot, parameters: Iterable[Parameter]) -> list[str]:
    """Return the imports that the annotations of parameters need."""
    return [f"import {package}.msg" for package in packages(robot.ros_type(p.type) for p in parameters)]


def tidy(text: str) -> str:
    """Return the text with at most two empty lines in a row, and one line end at its end."""
    while "\n\n\n\n" in text:
        text = text.replace("\n\n\n\n", "\n\n\n")
    return text.rstrip("\n") + "\n"
