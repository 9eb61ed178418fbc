"""Writes the tables of the package's README that the code has: ``python -m uav_simulator.page`` in the ROS 1 world.

What a fault is, says the comment behind its `SensorMode`; what an imperfection is, the docstring below its field.
"""

from __future__ import annotations

import ast
import inspect
import itertools
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from alula.common.files import write_text
from uav_simulator.imperfections import NAMES, PRESETS, Imperfections
from uav_simulator.sensors.faults import FAULTS, SensorMode

PAGE = Path(__file__).resolve().parents[2] / "README.md"
MARK = "<!-- Below this line: written by"


def main() -> int:
    """Write the tables anew; return the exit code."""
    write_text(PAGE, page(PAGE.read_text(encoding="utf-8")))
    return 0


def page(text: str) -> str:
    """Return the page with its tables replaced."""
    above, _, _ = text.partition(MARK)
    tables = "\n".join([*_faults(), "", *_imperfections()])
    return f"{above}{MARK} `python -m uav_simulator.page`, from the code. -->\n\n{tables}\n"


def _faults() -> Iterator[str]:
    yield from ("## Ways to fail", "", "| how | of | what is published, or happens |", "|---|---|---|")
    meanings = re.findall(r'^    [A-Z_]+ = "(\w+)"  # (.+)$', inspect.getsource(SensorMode), re.MULTILINE)
    for how, meaning in meanings:
        yield f"| `{how}` | {', '.join(sensor for sensor, ways in FAULTS.items() if how in ways)} | {meaning} |"


def _imperfections() -> Iterator[str]:
    yield from ("## Imperfections by name", "", "| name | realistic | what it is |", "|---|---|---|")
    meanings = dict(_documented())
    for name in NAMES:
        value = getattr(PRESETS["realistic"], name)
        yield f"| `{name}` | {f'{value:g}' if value != getattr(PRESETS['off'], name) else ''} | {meanings[name]} |"


def _documented() -> Iterator[tuple[str, str]]:
    """Yield each field with its docstring; one without has that of the field above."""
    (definition,) = ast.parse(inspect.getsource(Imperfections)).body
    assert isinstance(definition, ast.ClassDef)  # noqa: S101 - what getsource returns of a class
    text = ""
    for here, below in itertools.pairwise([*definition.body, ast.Pass()]):
        if isinstance(here, ast.AnnAssign):
            if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                text = str(below.value.value)
            yield ast.unparse(here.target), text


if __name__ == "__main__":
    sys.exit(main())
