"""Writes the tables of the package's README that the code has: ``python -m uav_simulator.page`` in the ROS 1 world.

What a fault is, says the comment behind its `SensorMode`; what an imperfection is, the docstring below its field.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from alula.common.files import write_text
from alula.common.generated import documented_fields, replaced, table
from uav_simulator.imperfections import NAMES, PRESETS, Imperfections
from uav_simulator.sensors.faults import FAULTS, SensorMode

PAGE = Path(__file__).resolve().parents[2] / "README.md"


def main() -> int:
    """Write the tables anew; return the exit code."""
    write_text(PAGE, page(PAGE.read_text(encoding="utf-8")))
    return 0


def page(text: str) -> str:
    """Return the page with its tables replaced."""
    return replaced(text, "python -m uav_simulator.page", "the code", [*_faults(), "", *_imperfections()])


def _faults() -> Iterator[str]:
    meanings = re.findall(r'^    [A-Z_]+ = "(\w+)"  # (.+)$', inspect.getsource(SensorMode), re.MULTILINE)
    rows = ((f"`{how}`", ", ".join(sensor for sensor, ways in FAULTS.items() if how in ways), meaning) for how, meaning in meanings)
    yield from ("## Ways to fail", "", *table(("how", "of", "what is published, or happens"), *rows))


def _imperfections() -> Iterator[str]:
    meanings = dict(documented_fields(Imperfections))
    off, realistic = PRESETS["off"], PRESETS["realistic"]
    values = {name: getattr(realistic, name) for name in NAMES}
    rows = ((f"`{name}`", f"{value:g}" if value != getattr(off, name) else "", meanings[name]) for name, value in values.items())
    yield from ("## Imperfections by name", "", *table(("name", "realistic", "what it is"), *rows))


if __name__ == "__main__":
    sys.exit(main())
