"""Slowly varying noise: a first-order Gauss-Markov process in three axes, seeded."""

from __future__ import annotations

import math
import random

from uav_simulator.frames import Vec3
from uav_simulator.imperfections import Imperfections

MEAN_M_S, GUST_M_S = 1.0, 0.5
STRONG_MEAN_M_S, STRONG_GUST_M_S = 8.0, 1.5  # what both scenarios fly in
RISE_S = 3.0  # how long a wind takes to become strong, and to calm down


class SlowNoise:
    """Three independent processes of standard deviation ``sigma`` and correlation time ``tau_s``, clipped at ``limit``."""

    def __init__(self, *, sigma: float, tau_s: float, limit: float, seed: str) -> None:
        self._sigma, self._tau_s, self._limit = sigma, tau_s, limit
        self._random = random.Random(seed)  # noqa: S311 - a repeatable noise, not a secret
        self.value: Vec3 = (0.0, 0.0, 0.0)

    def step(self, dt_s: float) -> Vec3:
        """Advance and return the new value."""
        keep = math.exp(-dt_s / self._tau_s)
        kick = self._sigma * math.sqrt(1.0 - keep * keep)
        gauss, limit = self._random.gauss, self._limit
        x, y, z = (max(-limit, min(limit, v * keep + gauss(0.0, kick))) for v in self.value)
        self.value = (x, y, z)
        return self.value


class Wind:
    """A mean wind with gusts, mild by default, in map, m/s; its direction depends on the seed.

    ``strong``: it rises where it was weaker, or stays so.
    """

    def __init__(self, *, seed: int, mean_m_s: float = MEAN_M_S, gust_m_s: float = GUST_M_S) -> None:
        direction = random.Random(f"wind {seed}").uniform(-math.pi, math.pi)  # noqa: S311 - repeatable on purpose
        self.strong = False
        self._strength = 0.0
        self._rise = max(STRONG_MEAN_M_S, mean_m_s) / mean_m_s - 1.0, max(STRONG_GUST_M_S, gust_m_s) / gust_m_s - 1.0
        self._mean = (mean_m_s * math.cos(direction), mean_m_s * math.sin(direction))
        self._gusts = SlowNoise(sigma=gust_m_s, tau_s=1.5, limit=3.0 * gust_m_s, seed=f"gusts {seed}")

    @classmethod
    def of(cls, imperfections: Imperfections, seed: int) -> Wind:
        """Return the wind that always blows, or a stronger one."""
        return cls(seed=seed, mean_m_s=max(MEAN_M_S, imperfections.wind_m_s), gust_m_s=max(GUST_M_S, imperfections.gust_m_s))

    def step(self, dt_s: float) -> Vec3:
        """Advance and return the wind; up and down it is a third as strong."""
        change = dt_s / RISE_S if self.strong else -dt_s / RISE_S
        self._strength = max(0.0, min(1.0, self._strength + change))
        mean, gust = (1.0 + self._strength * rise for rise in self._rise)
        x, y, z = self._gusts.step(dt_s)
        return mean * self._mean[0] + gust * x, mean * self._mean[1] + gust * y, gust * z / 3.0
