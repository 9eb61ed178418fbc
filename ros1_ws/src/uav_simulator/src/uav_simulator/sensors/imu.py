"""The inertial measurement unit: angular rates and specific force in body axes with white noise and a constant bias."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from uav_simulator.frames import Vec3

GYRO_NOISE_RAD_S = 0.003
ACCEL_NOISE_M_S2 = 0.05
GYRO_BIAS_RAD_S = 0.001
ACCEL_BIAS_M_S2 = 0.02


@dataclass(frozen=True)
class ImuReading:
    """Body FLU: rad/s, m/s2."""

    rates: Vec3
    specific_force: Vec3


class Imu:
    """A strapdown IMU in the body's frame, with biases drawn from the seed and white noise."""

    def __init__(self, seed: int, *, gyro_bias_rad_s: float = 0.0, accel_bias_m_s2: float = 0.0) -> None:
        """Standard deviations of the biases, on top of those that are always there."""
        self._random = random.Random(f"imu {seed}")  # noqa: S311 - repeatable on purpose
        self._gyro_bias = self._noisy((0.0, 0.0, 0.0), math.hypot(GYRO_BIAS_RAD_S, gyro_bias_rad_s))
        self._accel_bias = self._noisy((0.0, 0.0, 0.0), math.hypot(ACCEL_BIAS_M_S2, accel_bias_m_s2))

    def measure(self, rates: Vec3, specific_force: Vec3) -> ImuReading:
        """Return rates (rad/s) and specific force (m/s2), both forward-left-up, with bias and noise."""
        return ImuReading(
            self._noisy(rates, GYRO_NOISE_RAD_S, self._gyro_bias), self._noisy(specific_force, ACCEL_NOISE_M_S2, self._accel_bias)
        )

    def _noisy(self, v: Vec3, sigma: float, bias: Vec3 = (0.0, 0.0, 0.0)) -> Vec3:
        gauss = self._random.gauss
        return v[0] + bias[0] + gauss(0.0, sigma), v[1] + bias[1] + gauss(0.0, sigma), v[2] + bias[2] + gauss(0.0, sigma)
