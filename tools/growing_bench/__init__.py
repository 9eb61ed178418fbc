"""What benches of cases that grow share: each case in a process of its own, a line as soon as it is measured, JSON at the end."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

Row = dict[str, Any]
"""The figures of a case, by their names."""


def peak_mb() -> int:
    """Return the most memory that this process has had at a time, MB."""
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def tell_row(row: Row) -> int:
    """Print the figures of the one case of this process, for `measured_apart`; return the exit code."""
    sys.stdout.write(json.dumps(row) + "\n")
    return 0


def measured_apart(module: str, *words: str) -> Row:
    """Measure a case in a process of its own: `python -m MODULE WORDS`, which ends with `tell_row`."""
    done = subprocess.run([sys.executable, "-m", module, *words], check=True, stdout=subprocess.PIPE, text=True)
    row: Row = json.loads(done.stdout)
    return row


def tell_rows(columns: str, rows: Iterable[Row], **shown: Mapping[object, str]) -> list[Row]:
    """Print a table whose lines come as they are measured; return the rows.

    Args:
        columns: a format of a row, as ``{case:<15}{size:>5}``; its names are the head.
        rows: what is printed.
        shown: of a figure, what stands for a value of it.
    """
    found: list[Row] = []
    for row in rows:
        if not found:
            _say(columns.format(**{name: name for name in row}))
        found.append(row)
        _say(columns.format(**row | {name: words[row[name]] for name, words in shown.items()}))
    return found


def write_rows(path: Path | None, name: str, rows: list[Row], **more: object) -> None:
    """Write rows as JSON where that is wanted, with what ``more`` is said of all of them."""
    if path is not None:
        path.write_text(json.dumps({**more, name: rows}, indent=2) + "\n", encoding="utf-8")


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()
