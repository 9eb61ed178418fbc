"""``./alula compare``: runs side by side. Exit code 0: the same decisions, 1: not, 2: one can't be read."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.cli.table import parser_of
from alula.common.files import json_line, write_aside
from alula.records.comparing import compare, load_side
from alula.records.comparing.rendering import as_dict, lines
from alula.records.errors import AnalysisError

ALIKE, DIFFERENT, UNREADABLE = 0, 1, 2


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the command line's values; wrong ones, or a single run, print the usage on stderr and exit with code 2."""
    parser = parser_of("compare")
    given: argparse.Namespace = parser.parse_args(arguments)
    if len(given.runs) < 2:
        parser.error("one run alone can't be compared; name two or more")
    return given


def names(paths: Sequence[Path]) -> list[str]:
    """Return short names that differ where the paths do."""
    short = [path.resolve().name for path in paths]
    return short if len(set(short)) == len(short) else [str(path) for path in paths]


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare; return the exit code."""
    given = parse(sys.argv[1:] if arguments is None else arguments)
    try:
        sides = [load_side(path, name) for path, name in zip(given.runs, names(given.runs), strict=True)]
        compared = compare(sides, given.within)
        if given.svg is not None:
            from alula.records.comparing.picture import draw  # late: matplotlib takes a moment

            try:
                write_aside(given.svg, lambda aside: draw(compared, aside))
            except OSError as error:
                raise AnalysisError(f"--svg {given.svg}: can't be written: {error.strerror or error}") from None
    except (AnalysisError, OSError, ValueError) as error:
        sys.stderr.write(f"alula compare: {error}\n")
        return UNREADABLE
    sys.stdout.write(json_line(as_dict(compared)) if given.json else "\n".join(lines(compared)) + "\n")
    return ALIKE if compared.alike else DIFFERENT


if __name__ == "__main__":
    sys.exit(main())
