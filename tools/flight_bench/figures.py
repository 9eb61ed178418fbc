"""The figures of flights, as a table and for a file: medians over flights, by process and phase."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from flight_bench.watching import FLIGHT, PHASES, Cost, Watched

ACCURACY = (
    ("duration_s", ("duration_s",)),
    ("collisions", ("collisions",)),
    ("min_clearance_m", ("min_clearance_m",)),
    ("map_points", ("map", "points")),
    ("map_rmse_m", ("map", "rmse_m")),
    ("map_coverage", ("map", "coverage")),
    ("recovery_detected_s", ("recovery", "detected_s")),
    ("recovery_fallback_running_s", ("recovery", "fallback_running_s")),
    ("recovery_moving_again_s", ("recovery", "moving_again_s")),
)
"""What a faster flight must not give away: names, and where ``summary.json`` has them."""


@dataclass(frozen=True)
class Figures:
    """One flight: what it took, how it went. ``accuracy``: the numbers of `ACCURACY` that its summary has."""

    checkout: str
    outcome: str
    taken: Watched
    accuracy: Mapping[str, float]


def accuracy_of(summary: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers of a summary that tell how well the flight went."""
    found = {}
    for name, keys in ACCURACY:
        value: Any = summary
        for key in keys:
            value = value.get(key) if isinstance(value, Mapping) else None
        if isinstance(value, int | float):
            found[name] = float(value)
    return found


def medians(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the median of each value over the rows that have it."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: statistics.median(row[name] for row in rows if name in row) for name in names}


def typical(costs: Sequence[Cost]) -> dict[str, dict[str, float]]:
    """Return the median of each cell over flights; a process that a flight did not have took nothing in it."""
    names = dict.fromkeys(name for cost in costs for name in cost)
    none = dict.fromkeys(PHASES, 0.0)
    return {name: medians([cost.get(name, none) for cost in costs]) for name in names}


def table(flights: Sequence[Figures]) -> str:
    """Return a Markdown table of one checkout's flights, dearest process first, with what they took as a whole below it."""
    cpu_s = typical([one.taken.cpu_s for one in flights])
    memory_mb, wall_s = medians([one.taken.memory_mb for one in flights]), medians([one.taken.wall_s for one in flights])
    whole = {phase: sum(row[phase] for row in cpu_s.values()) for phase in PHASES}
    lines = [("process", *(f"{phase}, s" for phase in PHASES), "all, s", "MB"), ("---",) * (len(PHASES) + 3)]
    for name, row in sorted(cpu_s.items(), key=lambda item: -sum(item[1].values())):
        lines.append((name, *_seconds(row), f"{memory_mb[name]:.0f}" if name in memory_mb else ""))
    lines += [("**processor time**", *_seconds(whole), ""), ("**wall clock**", *_seconds(wall_s), "")]
    accuracy = medians([one.accuracy for one in flights])
    told = ", ".join(f"{name} {value:.4g}" for name, value in accuracy.items())
    outcomes = ", ".join(dict.fromkeys(one.outcome for one in flights))
    return "\n".join(["| " + " | ".join(line) + " |" for line in lines] + ["", f"{len(flights)} flown, {outcomes}; {told}"])


def _seconds(row: Mapping[str, float]) -> list[str]:
    return [*(f"{row[phase]:.1f}" for phase in PHASES), f"{sum(row.values()):.1f}"]


def ratio(flights: Sequence[Figures], others: Sequence[Figures]) -> str:
    """Say how much two checkouts differ: of each pair of flights, processor time of the first by that of the second."""
    pairs = list(zip(flights, others, strict=True))
    told = [f"all {_spread([_whole_s(one) / _whole_s(other) for one, other in pairs])}"]
    if all(_whole_s(other, FLIGHT) for other in others):  # else one has not departed
        told.append(f"in flight {_spread([_whole_s(one, FLIGHT) / _whole_s(other, FLIGHT) for one, other in pairs])}")
    return f"processor time, first by second: {', '.join(told)}"


def _whole_s(one: Figures, *phases: str) -> float:
    return sum(row[phase] for row in one.taken.cpu_s.values() for phase in phases or PHASES)


def _spread(values: Sequence[float]) -> str:
    return f"{statistics.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def as_json(flights: Sequence[Figures]) -> list[dict[str, object]]:
    """Return all figures of all flights, for a file."""
    return [asdict(one) for one in flights]
