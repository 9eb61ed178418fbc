"""``./alula expect``: writes expectations from a run, or holds a run against them. Ends with 0 (fulfilled), 1 (not), 2 (unreadable)."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from alula.cli.table import parser_of
from alula.common.files import write_text
from alula.records.errors import AnalysisError
from alula.records.expectations import Checked, check, expectations_of, junit, load_expectations
from alula.records.run import load_recorded_run

FULFILLED, FAILED, UNREADABLE = 0, 1, 2


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the command line's values; wrong ones print the usage on stderr and exit with code 2."""
    parser = parser_of("expect")
    given: argparse.Namespace = parser.parse_args(arguments)
    if given.junit is not None and given.check is None:
        parser.error("--junit writes the results of a check; add --check FILE")
    return given


def report(checked: Sequence[Checked]) -> int:
    """Print what failed and how many were fulfilled; return the exit code."""
    failed = [one for one in checked if one.problem]
    for one in failed:
        sys.stdout.write(f"{one}\n")
    sys.stdout.write(f"{len(checked) - len(failed)} of {len(checked)} expectations fulfilled\n")
    return FAILED if failed else FULFILLED


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check; return the exit code."""
    given = parse(sys.argv[1:] if arguments is None else arguments)
    try:
        if given.check is None:
            sys.stdout.write(expectations_of(load_recorded_run(given.run)))
            return FULFILLED
        expectations = load_expectations(given.check)
        checked = check(expectations, load_recorded_run(given.run))
        if given.junit is not None:
            write_text(given.junit, junit(str(given.run), checked))
    except (AnalysisError, OSError) as error:
        sys.stderr.write(f"alula expect: {error}\n")
        return UNREADABLE
    return report(checked)


if __name__ == "__main__":
    sys.exit(main())
