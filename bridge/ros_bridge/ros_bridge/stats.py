"""Figures of the bridge: how many crossed, how long they were inside, how many were dropped."""

from __future__ import annotations

import json
import math
import os
import threading
from pathlib import Path

# Durations fall into bins that grow by 5 %: any percentile of a run of any length, to 5 %, in constant memory.
BIN_GROWTH = 1.05
SHORTEST_NS = 1_000
BINS = 400  # the last begins at about 290 s
LOG_GROWTH = math.log(BIN_GROWTH)


class Durations:
    """A histogram of durations."""

    def __init__(self) -> None:
        self._bins = [0] * BINS
        self.count = 0

    def add(self, duration_ns: int) -> None:
        """Count one duration."""
        position = int(math.log(max(duration_ns, SHORTEST_NS) / SHORTEST_NS) / LOG_GROWTH)
        self._bins[min(position, BINS - 1)] += 1
        self.count += 1

    def percentile_ms(self, fraction: float) -> float | None:
        """Return the duration that the fraction 0..1 stays below, in ms to 5 %; None when nothing was counted."""
        remaining = fraction * self.count
        for position, number in enumerate(self._bins):
            remaining -= number
            if number and remaining <= 0:
                return float(round(SHORTEST_NS * BIN_GROWTH ** (position + 0.5) / 1e6, 4))
        return None


class RouteStats:
    """The figures of one topic or service; safe to fill from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._durations = Durations()
        self._dropped = 0
        self.errors = 0

    def crossed(self, duration_ns: int) -> None:
        """Count a message or call that crossed."""
        with self._lock:
            self._durations.add(duration_ns)

    def dropped(self, number: int = 1) -> None:
        """Count messages that had to give way to newer ones."""
        with self._lock:
            self._dropped += number

    def failed(self) -> int:
        """Count a message that could not be converted, or a call without an answer; return how many so far."""
        with self._lock:
            self.errors += 1
            return self.errors

    def summary(self) -> dict[str, float | int | None]:
        """Return ``count``, ``p50_ms``, ``p95_ms`` (None before the first), ``dropped``, ``errors``."""
        with self._lock:
            return {
                "count": self._durations.count,
                "p50_ms": self._durations.percentile_ms(0.50),
                "p95_ms": self._durations.percentile_ms(0.95),
                "dropped": self._dropped,
                "errors": self.errors,
            }


class Stats:
    """The figures of all routes."""

    def __init__(self) -> None:
        self.topics: dict[str, RouteStats] = {}
        self.services: dict[str, RouteStats] = {}

    def topic(self, name: str) -> RouteStats:
        """Return the figures of a topic, made at the first call."""
        return self.topics.setdefault(name, RouteStats())

    def service(self, name: str) -> RouteStats:
        """Return the figures of a service, made at the first call."""
        return self.services.setdefault(name, RouteStats())

    def summary(self) -> dict[str, dict[str, dict[str, float | int | None]]]:
        """Return ``{"topics": {name: figures}, "services": {name: figures}}``."""
        return {
            "topics": {name: stats.summary() for name, stats in self.topics.items()},
            "services": {name: stats.summary() for name, stats in self.services.items()},
        }

    def write(self, path: Path) -> None:
        """Write the summary as JSON, so that a reader sees the old file or the new one, never a part."""
        aside = path.with_name(f".{path.name}.{os.getpid()}")
        aside.write_text(json.dumps(self.summary(), indent=1) + "\n", encoding="utf-8")
        aside.replace(path)
