"""Compared runs as text and JSON: a column a run, or, of many, the distribution of each figure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median

from alula.records.comparing.sides import Compared, ComparedDecision, Side

SIDE_BY_SIDE = 6
"""More runs than these are shown as distributions."""


def spread(values: Sequence[float]) -> dict[str, float]:
    """Return least, median, 95th percentile (the smallest value that 95 % do not exceed) and most."""
    ordered = sorted(values)
    return {"min": ordered[0], "median": median(ordered), "p95": ordered[-(-95 * len(ordered) // 100) - 1], "max": ordered[-1]}


def as_dict(compared: Compared) -> dict[str, object]:
    """Return the comparison for JSON."""
    sides = [
        {"run": side.name, "outcome": side.outcome, "figures": dict(side.figures), "decisions": _plain(side)} for side in compared.sides
    ]
    distributions = {name: spread(values) for name, values in _known(compared).items()}
    differs_at = [one and one.at for one in compared.differences]
    return {
        "alike": compared.alike,
        "within_s": compared.within_s,
        "differs_at": differs_at,
        "runs": sides,
        "distributions": distributions,
    }


def _plain(side: Side) -> list[dict[str, object]]:
    return [{"what": decision.what, "at_s": round(decision.at_s, 6)} for decision in side.decisions]


def _known(compared: Compared) -> dict[str, list[float]]:
    """Return the values of each figure that some run has."""
    return {name: values for name in compared.units if (values := compared.values(name))}


def lines(compared: Compared) -> Iterator[str]:
    """Yield the comparison as text."""
    sides = compared.sides
    if len(sides) <= SIDE_BY_SIDE:
        yield from _table([["", *(side.name for side in sides)], *_columns(compared)])
    else:
        rows = [
            [_titled(compared, name), *(f"{value:.3f}" for value in spread(values).values())] for name, values in _known(compared).items()
        ]
        yield from _table([[f"{len(sides)} runs", "min", "median", "p95", "max"], *rows])
        outcomes = [side.outcome or "not known" for side in sides]
        yield "outcomes: " + ", ".join(f"{outcomes.count(one)} {one}" for one in dict.fromkeys(outcomes))
    yield ""
    yield from _decisions(compared)


def _columns(compared: Compared) -> Iterator[list[str]]:
    yield ["outcome", *(side.outcome or "not known" for side in compared.sides)]
    yield ["decisions", *(str(len(side.decisions)) for side in compared.sides)]
    for name in _known(compared):
        values = [side.figures.get(name) for side in compared.sides]
        yield [_titled(compared, name), *("-" if value is None else f"{value:.3f}" for value in values)]


def _titled(compared: Compared, name: str) -> str:
    unit = compared.units[name]
    return f"{name} ({unit})" if unit else name


def _table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        name, *cells = [cell.rjust(width) for cell, width in zip(row, widths, strict=True)]
        yield "  ".join([row[0].ljust(len(name)), *cells]).rstrip()


def _decisions(compared: Compared) -> Iterator[str]:
    """Yield where each run decides otherwise than the first."""
    first = compared.sides[0]
    if compared.alike:
        within = "" if compared.within_s is None else f" within {compared.within_s:g} s"
        yield f"same decisions{within}: {len(first.decisions)} decisions"
    for side, one in zip(compared.sides[1:], compared.differences, strict=True):
        if one is not None:
            yield f"decision {one.at + 1} differs: {_told(first, one.first)}; {_told(side, one.other)}"


def _told(side: Side, decision: ComparedDecision | None) -> str:
    if decision is None:
        return f"nothing more in {side.name}"
    return f"{decision.what} at {decision.at_s:.2f} s in {side.name}"
