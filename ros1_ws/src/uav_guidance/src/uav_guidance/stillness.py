"""For how long the vehicle has not come nearer to its target."""

from __future__ import annotations

import math

PROGRESS_M = 0.1
PROGRESS_RAD = math.radians(2.0)
PUSHED_AWAY_M = 0.5


class StillWatch:
    """Measure the time since the last progress: 0.1 m or 2 degrees nearer than ever before under this reference."""

    def __init__(self, *, reached_m: float, reached_rad: float) -> None:
        self.tune(reached_m=reached_m, reached_rad=reached_rad)
        self.restart(0.0)

    def tune(self, *, reached_m: float, reached_rad: float) -> None:
        """Set other limits."""
        self._reached_m, self._reached_rad = reached_m, reached_rad

    def restart(self, now_s: float) -> None:
        """Begin with a new reference."""
        self._progress_s = now_s
        self._best_m = self._best_rad = math.inf
        self._arrived = False

    def step(self, *, distance_m: float, heading_error_rad: float, now_s: float) -> float:
        """Return the seconds without progress; zero while nothing remains to be done.

        A vehicle that has arrived stays so until pushed away by half a metre: holding a place against the wind is no lack of progress.
        """
        error_rad = abs(heading_error_rad)
        near_m = PUSHED_AWAY_M if self._arrived else self._reached_m
        self._arrived = distance_m <= near_m and (self._arrived or error_rad <= self._reached_rad)
        nearer = distance_m <= self._best_m - PROGRESS_M or error_rad <= self._best_rad - PROGRESS_RAD
        if self._arrived or nearer:
            self._progress_s = now_s
            self._best_m, self._best_rad = min(self._best_m, distance_m), min(self._best_rad, error_rad)
        return max(0.0, now_s - self._progress_s)
