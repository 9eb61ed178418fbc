"""The satellites' fix, on which the estimator's horizontal position rests, and what is left of the position without it [18]."""

from __future__ import annotations

import math
import random

from uav_simulator.frames import Vec3

FIX_3D, NO_FIX, NO_GPS = 3, 1, 0  # GPS_FIX_TYPE
SILENT_S = 4.0  # until a receiver that says nothing is no receiver any more; until then nothing is told of it
RECKONED_S = 7.0  # for so long the position is reckoned from the accelerations, then it is given up
REGAINED_S = 1.0  # in which a position that was not given up follows the satellites again (time constant)
LEAK_M_S2 = 0.03  # of gravity, into an acceleration that is reckoned with: a tilt that is off by 0.17 degrees


class Satellites:
    """A receiver that fails in two ways: it reports that it has no fix (``jammed``), or nothing (``silent``)."""

    def __init__(self, seed: int) -> None:
        self.jammed = self.silent = False
        bearing_rad = random.Random(f"reckoning {seed}").uniform(-math.pi, math.pi)  # noqa: S311 - repeatable on purpose
        self._leak_m_s2: Vec3 = (LEAK_M_S2 * math.cos(bearing_rad), LEAK_M_S2 * math.sin(bearing_rad), 0.0)
        self._lost_s = 0.0
        self.offset: Vec3 = (0.0, 0.0, 0.0)
        """Error of the position that is reckoned, metres."""
        self.velocity: Vec3 = (0.0, 0.0, 0.0)
        """Of the velocity, m/s."""

    @property
    def fix(self) -> int | None:
        """Return the reported GPS_FIX_TYPE; None: none is reported."""
        if self.silent:
            return NO_GPS if self._lost_s >= SILENT_S else None
        return NO_FIX if self.jammed else FIX_3D

    @property
    def given_up(self) -> bool:
        """Return whether the estimator has no position any more."""
        return self._lost_s >= RECKONED_S

    def step(self, dt_s: float, *, flying: bool) -> None:
        """Advance by ``dt_s`` seconds; a vehicle that stands does not drift."""
        if not (self.jammed or self.silent):
            kept = 0.0 if self.given_up else math.exp(-dt_s / REGAINED_S)
            self._lost_s, self.velocity = 0.0, (0.0, 0.0, 0.0)
            self.offset = (kept * self.offset[0], kept * self.offset[1], 0.0)
            return
        self._lost_s += dt_s
        if flying:
            vx, vy, _ = self.velocity = _moved(self.velocity, self._leak_m_s2, dt_s)
            self.offset = _moved(self.offset, (vx, vy, 0.0), dt_s)
        else:
            self.velocity = (0.0, 0.0, 0.0)


def _moved(start: Vec3, rate: Vec3, dt_s: float) -> Vec3:
    return start[0] + rate[0] * dt_s, start[1] + rate[1] * dt_s, start[2] + rate[2] * dt_s
