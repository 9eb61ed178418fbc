"""How nodes may end, as far as it can be told before anything is ticked: each class tells it of itself, of its ports and children."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias

from alula.trees.status import ANSWERS, FAILURE, RUNNING, SKIPPED, SUCCESS, Answer

Ends: TypeAlias = frozenset[Answer]
"""Answers that a node may give besides RUNNING. None at all: it only ever runs."""
Given: TypeAlias = Callable[[str], str | None]
"""Returns the text of a port, of the file or by default; an entry's value is not known."""

NO_END: Ends = frozenset()
SUCCEEDS: Ends = frozenset({SUCCESS})
FAILS: Ends = frozenset({FAILURE})
ENDS: Ends = SUCCEEDS | FAILS
SKIPS: Ends = frozenset({SKIPPED})
ANY_END: Ends = ENDS | SKIPS


def goes_past(child: Ends, goes_on: Answer) -> bool:
    """Return whether a node that goes on after an answer may go on after this child."""
    return goes_on in child or SKIPPED in child


def stops_at(children: Sequence[Ends], goes_on: Answer) -> int | None:
    """Return the child after which a node that ticks them in turn never goes on, None where it may get past the last."""
    return next((number for number, child in enumerate(children) if not goes_past(child, goes_on)), None)


def together(children: Iterable[Ends]) -> Ends:
    """Return the ends of any of them."""
    return frozenset().union(*children)


def whole_number(given: Given, port: str) -> int | None:
    """Return the number in a port, None where an entry has it, or where it is none."""
    try:
        return int(given(port) or "")
    except ValueError:
        return None


def answer_in(given: Given, port: str) -> Ends:
    """Return the ends that a port may name: any where an entry has it."""
    known = ANSWERS.get((given(port) or "").strip())
    return ANY_END if known is None else frozenset({known}) - {RUNNING}
