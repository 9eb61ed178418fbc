"""Two driven wheels: from a commanded twist to how the rover moves, and to what odometry makes of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

TRACK_M = 0.36
MAX_WHEEL_M_S = 0.8
ACCELERATION_M_S2 = 1.5  # of each wheel
COMMAND_TIMEOUT_S = 0.5  # a base stops by itself when no command comes any more
WEAK = 0.55  # part of its speed that a weak motor reaches
SLIP = 0.5  # part of the way that wheels lose which slip
SCALE_ERROR = 0.002  # of each wheel's odometry, standard deviation over rovers
NOISE = 0.02  # of each step's, standard deviation

Pose = tuple[float, float, float]
"""x, y in metres, yaw in radians."""
Speeds = NDArray[np.float64]
"""Of the left and the right wheel, m/s."""


def moved(pose: Pose, forward_m: float, turn_rad: float) -> Pose:
    """Return a pose after an arc."""
    x, y, yaw = pose
    middle = yaw + turn_rad / 2.0
    return x + forward_m * math.cos(middle), y + forward_m * math.sin(middle), math.remainder(yaw + turn_rad, math.tau)


class Wheels:
    """Speeds are (v, w): metres a second forwards, radians a second to the left."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._scale = 1.0 + rng.normal(0.0, SCALE_ERROR, 2)
        self._wanted: Speeds = np.zeros(2)
        self._wanted_at_s = -math.inf
        self._turning: Speeds = np.zeros(2)
        self.odometry: Pose = (0.0, 0.0, 0.0)
        self.odometry_speed = (0.0, 0.0)

    def command(self, v_m_s: float, w_rad_s: float, now_s: float) -> None:
        """Take a command; what one wheel can't do slows both, so that the curve stays."""
        wanted = np.array([v_m_s - w_rad_s * TRACK_M / 2.0, v_m_s + w_rad_s * TRACK_M / 2.0])
        self._wanted = wanted / max(1.0, float(np.abs(wanted).max()) / MAX_WHEEL_M_S)
        self._wanted_at_s = now_s

    def step(self, now_s: float, period_s: float, *, slip: bool, weak: bool) -> tuple[float, float]:
        """Turn the wheels for a period, count odometry, and return the speed at which the rover moves on the floor."""
        wanted = self._wanted if now_s - self._wanted_at_s <= COMMAND_TIMEOUT_S else np.zeros(2)
        if weak:
            wanted = wanted * np.array([1.0, WEAK])
        most = ACCELERATION_M_S2 * period_s
        self._turning = self._turning + np.clip(wanted - self._turning, -most, most)
        counted = self._turning * self._scale * (1.0 + self._rng.normal(0.0, NOISE, 2))
        self.odometry_speed = _twist(counted)
        self.odometry = moved(self.odometry, self.odometry_speed[0] * period_s, self.odometry_speed[1] * period_s)
        v, w = _twist(self._turning)
        return (v * (1.0 - SLIP), w * (1.0 - SLIP)) if slip else (v, w)


def _twist(wheels: Speeds) -> tuple[float, float]:
    return float(wheels.mean()), float(wheels[1] - wheels[0]) / TRACK_M
