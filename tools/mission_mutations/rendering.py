"""The counts by kind of mutant as a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from mission_mutations.flights import NOTHING, OTHERWISE, REFUSED, WRONG, Campaigned
from mission_mutations.judging import COMPARED, EQUAL, FOUND, MISSED, Verdict
from mission_mutations.mutants import KINDS

HEAD = "| what was done to a mission or model | mutants | found by `check` | found beside the original | flown | equal | missed | CPU, s |"


def table(verdicts: Sequence[Verdict]) -> str:
    """Return a table of Markdown; a flight shows those that are `flown`."""
    rows = [_row(kind, [one for one in verdicts if one.kind == kind]) for kind in KINDS]
    return "\n".join([HEAD, "|---|---|---|---|---|---|---|---|", *rows, _row("**all**", verdicts)])


def _row(kind: str, verdicts: Sequence[Verdict]) -> str:
    count = Counter(one.verdict for one in verdicts)
    flown = sum(one.verdict == FOUND and bool(one.flown) for one in verdicts)
    taken_s = sum(one.cpu_s for one in verdicts)
    beside = sum(one.by in COMPARED for one in verdicts)
    return f"| {kind} | {len(verdicts)} | {count[FOUND] - beside} | {beside} | {flown} | {count[EQUAL]} | {count[MISSED]} | {taken_s:.0f} |"


FLIGHTS = (
    "| what was done to a mission or model | mutants | refused | a flight is wrong | another course only | not seen | flights | CPU, s |"
)


def table_of_flights(several: Sequence[Campaigned]) -> str:
    """Return what flights over mocks have found as a table of Markdown."""
    rows = [_row_of_flights(kind, [one for one in several if one.kind == kind]) for kind in KINDS]
    return "\n".join([FLIGHTS, "|---|---|---|---|---|---|---|---|", *rows, _row_of_flights("**all**", several)])


def _row_of_flights(kind: str, several: Sequence[Campaigned]) -> str:
    count = Counter(one.by for one in several)
    seen = " | ".join(str(count[by]) for by in (REFUSED, WRONG, OTHERWISE, NOTHING))
    flights, taken_s = sum(one.flights for one in several), sum(one.cpu_s for one in several)
    return f"| {kind} | {len(several)} | {seen} | {flights} | {taken_s:.0f} |"


def by_what(verdicts: Sequence[Verdict]) -> str:
    """Return what found how many, most first, and the missed ones one by one."""
    count = Counter(one.by for one in verdicts if one.verdict == FOUND)
    lines = [f"found by: {', '.join(f'{by} {number}' for by, number in count.most_common())}"]
    lines += [f"missed: {one.mission}: {one.kind}: {one.what} ({one.told})" for one in verdicts if one.verdict == MISSED]
    return "\n".join(lines)
