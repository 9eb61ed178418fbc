"""Statistics of what was measured, the aims, and how both are told. No ROS."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

Samples = Mapping[str, Sequence[float]]

REQUEST_AIM, VIOLATION_AIM, IDLE_AIM_PERCENT = 1.5, 3.0, 3.0
HEADINGS = (
    "case",
    "request to RUNNING",
    "bare goal accepted",
    "ratio",
    "extern transition to violation",
    "its event",
    "bare topic",
    "ratio",
    "interrupt to INTERRUPTED",
    "memory MB",
    "idle CPU %",
)


@dataclass(frozen=True)
class Times:
    """Median and 95th percentile of durations, ms."""

    p50_ms: float
    p95_ms: float
    number: int

    def __str__(self) -> str:
        return f"{self.p50_ms:.2f} / {self.p95_ms:.2f}"


@dataclass(frozen=True)
class Load:
    """What a process takes while nothing happens: resident memory, and percent of one core."""

    rss_mb: float
    idle_percent: float


@dataclass(frozen=True)
class Measured:
    """All figures of a case; ``times`` by name: request, interrupt, violation, told, asked, goal, topic."""

    case: str
    skills: int
    resources: int
    times: Mapping[str, Times]
    load: Load

    @property
    def request_ratio(self) -> float:
        """Request to RUNNING by the acceptance of a bare goal; medians, of the same minute."""
        return self.times["request"].p50_ms / self.times["goal"].p50_ms

    @property
    def violation_ratio(self) -> float:
        """Extern transition to the handle's end by a bare topic's latency; medians, of the same minute."""
        return self.times["violation"].p50_ms / self.times["topic"].p50_ms


def percentile(samples: Sequence[float], percent: float) -> float:
    """Return the value below which so many percent lie, between the two nearest samples in proportion.

    Raises:
        ValueError: there are no samples, or percent is not within 0 to 100.
    """
    if not samples or not 0 <= percent <= 100:
        raise ValueError(f"the {percent:g}th percentile of {len(samples)} samples; it takes one at least, and 0 to 100")
    ordered = sorted(samples)
    place = (len(ordered) - 1) * percent / 100
    low = int(place)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (place - low) * (ordered[high] - ordered[low])


def times_of(samples: Samples) -> dict[str, Times]:
    """Return the times by name, from samples by name with the unit: ``request_ms`` to ``request``."""
    return {
        name.removesuffix("_ms"): Times(statistics.median(values), percentile(values, 95), len(values)) for name, values in samples.items()
    }


def join(blocks: Sequence[Samples]) -> dict[str, list[float]]:
    """Return the samples of all blocks by name."""
    names = dict.fromkeys(name for block in blocks for name in block)
    return {name: [value for block in blocks for value in block.get(name, ())] for name in names}


def idle_percent(before_cpu_s: float, after_cpu_s: float, window_s: float) -> float:
    """Return the share of one core that was taken in the window."""
    return 100 * (after_cpu_s - before_cpu_s) / window_s


def row(measured: Measured) -> tuple[str, ...]:
    """Return a case's line of the table."""
    times = measured.times
    return (
        measured.case,
        str(times["request"]),
        str(times["goal"]),
        f"{measured.request_ratio:.2f}",
        str(times["violation"]),
        str(times["told"]),
        str(times["topic"]),
        f"{measured.violation_ratio:.2f}",
        str(times["interrupt"]),
        f"{measured.load.rss_mb:.0f}",
        f"{measured.load.idle_percent:.1f}",
    )


def table(cases: Sequence[Measured]) -> str:
    """Return a Markdown table, a line a case."""
    lines = [HEADINGS, ("---",) * len(HEADINGS), *(row(case) for case in cases)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def verdicts(cases: Sequence[Measured]) -> list[str]:
    """Return a line for each aim: the worst case beside it."""
    lines = [
        _verdict("request to RUNNING", "x a bare goal's acceptance", REQUEST_AIM, {case.case: case.request_ratio for case in cases}),
        _verdict("violation to client", "x a bare topic's latency", VIOLATION_AIM, {case.case: case.violation_ratio for case in cases}),
    ]
    idle = {case.case: case.load.idle_percent for case in cases}
    return [*lines, _verdict("idle CPU of the managers", "% of a core", IDLE_AIM_PERCENT, idle)]


def _verdict(what: str, unit: str, aim: float, figures: Mapping[str, float]) -> str:
    missed = [f"{figure:.2f} with {case}" for case, figure in figures.items() if figure > aim]
    worst = max(figures, key=lambda case: figures[case])
    told = f"MISSED: {', '.join(missed)}" if missed else f"met: at most {figures[worst]:.2f} ({worst})"
    return f"{what}: aim <= {aim:g} {unit}; {told}"


def as_json(cases: Sequence[Measured], bare: Load) -> dict[str, object]:
    """Return everything for a file."""
    told = [asdict(case) | {"request_ratio": case.request_ratio, "violation_ratio": case.violation_ratio} for case in cases]
    return {
        "aims": {"request_ratio": REQUEST_AIM, "violation_ratio": VIOLATION_AIM, "idle_percent": IDLE_AIM_PERCENT},
        "bare": asdict(bare),
        "cases": told,
    }
