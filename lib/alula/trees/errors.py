"""What is wrong with a tree: where, what, and what to do about it."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from alula.common.errors import AlulaError
from alula.common.public import public


@dataclass(frozen=True)
class Place:
    """A place in a file: line and column from 1, in characters."""

    path: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.path}:{self.line}:{self.column}"


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in a file, and what to do about it; the cure may be empty.

    ``code`` is its number in docs/reference/mission-checks.md, ``length`` that of the text that it is about, in characters;
    a warning keeps no tree from being ticked.
    """

    place: Place
    message: str
    cure: str = ""
    code: str = "ALU602"
    length: int = 1
    warning: bool = False

    def __str__(self) -> str:
        return f"{self.place}: {self.message}" + (f"; {self.cure}" if self.cure else "")


@public("alula.trees")
class TreeError(AlulaError):
    """A tree can't be read, built or ticked; the message is one line that says what and where."""


@public("alula.trees")
class FileError(TreeError):
    """A file of trees can't be used; ``problem`` has the place and what is wrong."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(str(problem))
        self.problem = problem


@public("alula.trees")
class TickError(TreeError):
    """A node can't be ticked: a port has no value, a script fails, a child answers what it may not."""


Report = Callable[[Problem], None]
"""Takes a problem. What is read can go on after it: a checker collects all, a loader raises at the first that is no warning."""


def refuse(problem: Problem) -> None:
    """Raise FileError at a problem that is no warning."""
    if not problem.warning:
        raise FileError(problem)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a cure that names what is spelled alike; empty when nothing is."""
    alike = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f"did you mean {alike[0]}?" if alike else ""
