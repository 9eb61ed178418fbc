"""The part of a page that a program writes: all that stands below the line that begins with MARK."""

from __future__ import annotations

import ast
import inspect
import itertools
from collections.abc import Iterable, Iterator, Mapping

from alula.common.keys import Key

MARK = "<!-- Below this line: written by"


def replaced(text: str, command: str, source: str, lines: Iterable[str]) -> str:
    """Return a page whose generated part is these lines; ``command`` writes it from ``source``."""
    above, _, _ = text.partition(MARK)
    return "\n".join([f"{above}{MARK} `{command}`, from {source}. -->", "", *lines]).rstrip() + "\n"


def table(*rows: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of a table; the first row is its head."""
    head, *below = rows
    yield from (f"| {' | '.join(head)} |", f"|{'---|' * len(head)}")
    yield from (f"| {' | '.join(row)} |" for row in below)


def key_table(keys: Mapping[str, Key]) -> Iterator[str]:
    """Yield the lines of a table of keys."""
    yield from table(("key", "what it says", "without it"), *((f"`{name}`", key.about, key.without) for name, key in keys.items()))


def documented_fields(kind: type) -> Iterator[tuple[str, str]]:
    """Yield each field of a class with the docstring below it; one without has that of the field above."""
    (definition,) = ast.parse(inspect.getsource(kind)).body
    assert isinstance(definition, ast.ClassDef)  # noqa: S101 - what getsource returns of a class
    text = ""
    for here, below in itertools.pairwise([*definition.body, ast.Pass()]):
        if isinstance(here, ast.AnnAssign):
            if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                text = str(below.value.value)
            yield ast.unparse(here.target), text
