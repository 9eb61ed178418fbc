"""Figures of the bridge: how many crossed, how long they were inside, how many were dropped."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

# Durations fall into bins that grow by 5 %: any percentile of a run of any length, to 5 %, in constant memory.
BIN_GROWTH = 1.05
SHORTEST_NS = 1_000
BINS = 400  # the last begins at about 290 s
LOG_GROWTH = math.log(BIN_GROWTH)


class Durations:
    """A histogram of durations in bins of logarithmic width."""

    def __init__(self) -> None:
        self._bins: npt.NDArray[np.int64] = np.zeros(BINS, np.int64)
        self.count = 0

    @classmethod
    def of(cls, bins: Sequence[int]) -> Durations:
        """Return the histogram of what the data plane has counted, in the same bins."""
        durations = cls()
        durations._bins = np.array(bins, np.int64)
        durations.count = int(durations._bins.sum())
        return durations

    def add(self, duration_ns: int) -> None:
        """Count a duration in nanoseconds; one beyond the last bin goes into that."""
        position = int(math.log(max(duration_ns, SHORTEST_NS) / SHORTEST_NS) / LOG_GROWTH)
        self._bins[min(position, BINS - 1)] += 1
        self.count += 1

    def percentile_ms(self, fraction: float) -> float | None:
        """Return the duration that the fraction (above 0, at most 1) stays below, in ms to 5 %; None when nothing was counted."""
        if not self.count:
            return None
        position = int(np.searchsorted(np.cumsum(self._bins), fraction * self.count))
        return float(round(SHORTEST_NS * BIN_GROWTH ** (min(position, BINS - 1) + 0.5) / 1e6, 4))


@dataclass(frozen=True)
class Figures:
    """What has crossed a route since it was made. Durations are inside the bridge; None before the first."""

    count: int = 0
    bytes: int = 0
    p50_ms: float | None = None
    p95_ms: float | None = None
    dropped: Mapping[str, int] = field(default_factory=dict)  # reason: number
    errors: int = 0

    def after(self, earlier: Figures) -> Figures:
        """Return the figures of a route that was made again: counts go on, durations are those of the newer part."""
        reasons = earlier.dropped.keys() | self.dropped.keys()
        return Figures(
            count=earlier.count + self.count,
            bytes=earlier.bytes + self.bytes,
            p50_ms=earlier.p50_ms if self.p50_ms is None else self.p50_ms,
            p95_ms=earlier.p95_ms if self.p95_ms is None else self.p95_ms,
            dropped={reason: earlier.dropped.get(reason, 0) + self.dropped.get(reason, 0) for reason in sorted(reasons)},
            errors=earlier.errors + self.errors,
        )


class RouteStats:
    """The figures of one route while Python counts them; safe to fill from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._durations = Durations()
        self._bytes = 0
        self.errors = 0

    def crossed(self, duration_ns: int, size_bytes: int = 0) -> None:
        """Count a message or call that crossed, and the bytes that went out."""
        with self._lock:
            self._durations.add(duration_ns)
            self._bytes += size_bytes

    def failed(self) -> int:
        """Count a message that could not be converted, or a call without an answer; return how many so far."""
        with self._lock:
            self.errors += 1
            return self.errors

    def figures(self) -> Figures:
        """Return the figures so far."""
        with self._lock:
            return Figures(
                count=self._durations.count,
                bytes=self._bytes,
                p50_ms=self._durations.percentile_ms(0.50),
                p95_ms=self._durations.percentile_ms(0.95),
                errors=self.errors,
            )
