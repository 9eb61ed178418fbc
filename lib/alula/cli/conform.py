"""``./alula conform``: holds a log against the models of its skillsets. Ends with 0: it conforms, 1: it does not, 2: it can't be read.

With ``--complete`` a log that misses something conforms only up to there, and that ends with 1, too.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

from alula.cli.table import parse
from alula.common.files import json_line
from alula.records.conformance import ConformanceVerdict, judge
from alula.records.errors import AnalysisError
from alula.records.logs import Log, read_log

CONFORMS, DIFFERS, UNREADABLE = 0, 1, 2


def lines(log: Log, verdict: ConformanceVerdict) -> Iterator[str]:
    """Yield the verdict as text."""
    if verdict.conforms:
        yield f"{log.path}: conforms: {verdict.events} events of {', '.join(log.skillsets)}"
    else:
        yield f"{log.path}: does not conform"
    if verdict.assumed:
        yield f"  if {', '.join(verdict.assumed)} from the beginning on: no event is about it, as in a log that is older than the model"
    for finding in verdict.findings:
        yield f"  {finding}"
        yield "    the models allow instead: " + "; ".join(finding.allowed)
    for name, stamps in verdict.restarts.items():
        yield f"  {name} was restarted at {', '.join(f'{stamp_s:.3f} s' for stamp_s in stamps)}"
    if verdict.open:
        yield f"  open at the end: {', '.join(verdict.open)}"
    if verdict.owed:
        yield f"  it ends within a step; {'; '.join(verdict.owed)} should follow"
    if log.cut:
        yield f"  read up to the damage: {log.cut}"


def holes(log: Log, verdict: ConformanceVerdict) -> tuple[str, ...]:
    """Return what a log misses: what lies behind its break, and the rest of the step that it ends within."""
    return (*([f"it breaks off: {log.cut}"] if log.cut else []), *(f"{owed} should follow" for owed in verdict.owed))


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge; return the exit code."""
    given = parse("conform", arguments)
    try:
        log = read_log(given.log)
        verdict = judge(log, given.model)
    except AnalysisError as error:
        sys.stderr.write(f"alula conform: {error}\n")
        return UNREADABLE
    if given.json:
        sys.stdout.write(json_line({"log": str(log.path), **verdict.as_dict(), "cut": log.cut}))
    else:
        sys.stdout.write("\n".join(lines(log, verdict)) + "\n")
    missing = holes(log, verdict) if given.complete else ()
    if missing:
        sys.stderr.write(f"alula conform: {log.path}: is not complete: {'; '.join(missing)}\n")
    return CONFORMS if verdict.conforms and not missing else DIFFERS


if __name__ == "__main__":
    sys.exit(main())
