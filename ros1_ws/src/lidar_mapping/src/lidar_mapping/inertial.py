"""The state of a LiDAR-inertial odometry: propagated by inertial readings, corrected by whatever measures pose or velocity.

An error-state Kalman filter in information form. Its 21 error terms are, in this order: attitude (rotation vector in the body frame),
velocity and position (map frame, ENU), gyro bias and accelerometer bias (body frame), the error of the autopilot's attitude (rotation
vector in the map frame), and the drift of its position (map frame, metres a metre flown). Both errors change slowly, so a hundred
attitudes or velocities within a few seconds know no more than one.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import gtsam
import numpy as np

from perception_core import NS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Linearise = Callable[["InertialState"], tuple[Floats, Floats]]

GRAVITY = np.array([0.0, 0.0, -9.81])
ATTITUDE, VELOCITY, POSITION, GYRO_BIAS, ACCEL_BIAS, AUTOPILOT, DRIFT = (slice(3 * i, 3 * i + 3) for i in range(7))
HEADING = 2  # of the attitude, while the vehicle is level
UP = 8  # of the position
TERMS = 21
HISTORY = 2000
"""States kept since the last sweep: of a few seconds, for the autopilot may have been silent."""
SHAKING_S = 0.3
UNIT = np.eye(3)


@dataclass(frozen=True)
class ImuReading:
    """One reading in the body frame: rates rad/s, specific force m/s2."""

    stamp_ns: int
    rates: Floats
    specific_force: Floats


@dataclass(frozen=True)
class InertialNoise:
    """Densities of the noise (per root hertz) and what is known at the start (standard deviations).

    Readings that spread more than by ``gyro`` and ``accel`` are believed less (`Shaking`). The gyro's bias changes by ``gyro_walk`` only:
    along bare walls each scan is laid onto what the last ones have turned, and a bias that gives way learns that turn and goes on with it.

    Without inertial readings the vehicle is assumed to keep its velocity and attitude; ``free_m_s2`` and ``free_rad_s`` say how badly
    (root mean square over one second). The autopilot's attitude is off by ``autopilot_tilt_rad`` about each horizontal axis and by
    ``autopilot_heading_rad``, which change within ``autopilot_s``; its position drifts along each axis by ``autopilot_drift`` of the way,
    which changes within ``autopilot_drift_s`` (first-order Gauss-Markov processes).
    """

    gyro: float = 0.0005
    accel: float = 0.05
    gyro_walk: float = 1e-5
    accel_walk: float = 5e-4
    free_rad_s: float = 0.5
    free_m_s2: float = 3.0
    start_attitude_rad: float = 0.01
    start_velocity_m_s: float = 0.1
    start_gyro_bias: float = 0.003
    start_accel_bias: float = 0.05
    autopilot_tilt_rad: float = 0.01
    autopilot_heading_rad: float = 0.05
    autopilot_s: float = 30.0
    autopilot_drift: float = 0.05
    autopilot_drift_s: float = 60.0

    @property
    def autopilot_rad(self) -> Floats:
        """The standard deviation of the autopilot's attitude about the map's axes, (3,)."""
        return np.array([self.autopilot_tilt_rad, self.autopilot_tilt_rad, self.autopilot_heading_rad])


@dataclass(frozen=True)
class InertialState:
    """``rotation`` (3, 3) is R_map_base; the rest are (3,) vectors.

    The autopilot says Exp(``autopilot_error``) R_map_base, and ``velocity`` + speed * ``autopilot_drift``.
    """

    rotation: Floats
    velocity: Floats
    position: Floats
    gyro_bias: Floats = field(default_factory=lambda: np.zeros(3))
    accel_bias: Floats = field(default_factory=lambda: np.zeros(3))
    autopilot_error: Floats = field(default_factory=lambda: np.zeros(3))
    autopilot_drift: Floats = field(default_factory=lambda: np.zeros(3))

    @property
    def matrix(self) -> Floats:
        """The pose as a transform, T_map_base, (4, 4) float64."""
        transform = np.eye(4)
        transform[:3, :3], transform[:3, 3] = self.rotation, self.position
        return transform

    def plus(self, error: Floats) -> InertialState:
        """Return the state moved by an error (21,)."""
        return InertialState(
            self.rotation @ rotation_matrix(error[ATTITUDE]),
            self.velocity + error[VELOCITY],
            self.position + error[POSITION],
            self.gyro_bias + error[GYRO_BIAS],
            self.accel_bias + error[ACCEL_BIAS],
            self.autopilot_error + error[AUTOPILOT],
            self.autopilot_drift + error[DRIFT],
        )

    def minus(self, other: InertialState) -> Floats:
        """Return the error (21,) that leads from ``other`` to this state."""
        turn = rotation_vector(other.rotation.T @ self.rotation)
        shifts = (
            self.velocity - other.velocity,
            self.position - other.position,
            self.gyro_bias - other.gyro_bias,
            self.accel_bias - other.accel_bias,
            self.autopilot_error - other.autopilot_error,
            self.autopilot_drift - other.autopilot_drift,
        )
        return np.concatenate([turn, *shifts])


class Shaking:
    """The noise of inertial readings by themselves: how far each one lies off the line between its neighbours.

    A vehicle that is shaken, or whose frame vibrates, feels much more than the sensor's noise. A motion that it is worth to follow hardly
    bends within two periods: at 50 Hz a turn of 1 rad/s that begins within 0.5 s lies 0.002 rad/s off the line.
    """

    def __init__(self) -> None:
        self._newest: deque[ImuReading] = deque(maxlen=3)
        self._variances: tuple[float, ...] = (0.0, 0.0)

    def densities(self, reading: ImuReading) -> tuple[float, float]:
        """Take the next reading; return the densities per root hertz of rates and specific force over the last `SHAKING_S`."""
        self._newest.append(reading)
        if len(self._newest) < 3:
            return 0.0, 0.0
        first, middle, last = self._newest
        long_s, short_s = ((each.stamp_ns - first.stamp_ns) / NS for each in (last, middle))
        share = short_s / long_s
        spread = 3.0 * (1.0 + share**2 + (1.0 - share) ** 2)  # of white noise of one reading, three axes
        off = [
            (1.0 - share) * first.rates + share * last.rates - middle.rates,
            (1.0 - share) * first.specific_force + share * last.specific_force - middle.specific_force,
        ]
        fading = math.exp(-(long_s - short_s) / SHAKING_S)
        seen = (float(each @ each) * 0.5 * long_s / spread for each in off)
        self._variances = tuple(fading * before + (1.0 - fading) * now for before, now in zip(self._variances, seen, strict=True))
        gyro, accel = map(math.sqrt, self._variances)
        return gyro, accel


class InertialFilter:
    """Propagates and corrects a `State`; not thread-safe."""

    def __init__(self, noise: InertialNoise, stamp_ns: int, start: InertialState) -> None:
        self._noise = noise
        self.stamp_ns = stamp_ns
        self.state = start
        sigmas = (noise.start_attitude_rad, noise.start_velocity_m_s, 1e-3, noise.start_gyro_bias, noise.start_accel_bias)
        self.covariance: Floats = np.diag(np.square([*np.repeat(sigmas, 3), *noise.autopilot_rad, *np.full(3, noise.autopilot_drift)]))
        self._last: ImuReading | None = None
        self._shaking = Shaking()
        self.history: deque[tuple[int, InertialState]] = deque([(stamp_ns, start)], maxlen=HISTORY)

    def propagate(self, reading: ImuReading) -> None:
        """Move to the reading's moment; one that is not later is left out.

        A reading tells of its moment: from the reading before on, the mean of both counts, for a vehicle that begins to turn at 1 rad/s
        would else be ahead by half a period, 0.6 degrees at 50 Hz, until it ends its turn.
        """
        duration_s = (reading.stamp_ns - self.stamp_ns) / NS
        if duration_s > 0.0:
            before = self._last if self._last is not None and self._last.stamp_ns == self.stamp_ns else reading
            self._last = reading
            gyro, accel = self._shaking.densities(reading)
            rates = 0.5 * (before.rates + reading.rates) - self.state.gyro_bias
            force = 0.5 * (before.specific_force + reading.specific_force) - self.state.accel_bias
            noise = self._noise
            densities = (max(noise.gyro, gyro), max(noise.accel, accel), 0.0, noise.gyro_walk, noise.accel_walk)
            self._move(reading.stamp_ns, rates, self.state.rotation @ force + GRAVITY, force, densities)

    def coast(self, stamp_ns: int) -> None:
        """Move to a moment without any reading: attitude and velocity are kept, and become uncertain."""
        duration_s = (stamp_ns - self.stamp_ns) / NS
        if duration_s > 0.0:
            noise = self._noise
            densities = (noise.free_rad_s, noise.free_m_s2, 0.0, noise.gyro_walk, noise.accel_walk)
            self._move(stamp_ns, np.zeros(3), np.zeros(3), np.zeros(3), densities)

    def correct(self, linearise: Linearise, *, least: int = 1, most: int = 1) -> None:
        """Take a measurement that was linearised about the state: an information matrix (21, 21) and a gradient (21,), iterated.

        Small steps end the iterations after the ``least``: a measurement may narrow its gates as it goes.
        """
        predicted, information_before = self.state, np.linalg.inv(self.covariance)
        information = information_before
        for iteration in range(1, most + 1):
            measured, gradient = linearise(self.state)
            information = information_before + measured
            slope = gradient + information_before @ self.state.minus(predicted)
            step: Floats = -np.asarray(np.linalg.solve(information, slope), dtype=np.float64)
            self.state = self.state.plus(step)
            if iteration >= least and np.abs(step[POSITION]).max() < 5e-4 and np.abs(step[ATTITUDE]).max() < 1e-4:
                break
        covariance = np.linalg.inv(information)
        self.covariance = 0.5 * (covariance + covariance.T)
        self.history[-1] = (self.stamp_ns, self.state)

    def keep(self) -> Callable[[], None]:
        """Return what takes back all corrections from now on; not for use across a propagation."""
        state, covariance, last = self.state, self.covariance, self.history[-1]

        def take_back() -> None:
            self.state, self.covariance, self.history[-1] = state, covariance, last

        return take_back

    def _move(self, stamp_ns: int, rates: Floats, acceleration: Floats, force: Floats, densities: tuple[float, ...]) -> None:
        duration_s = (stamp_ns - self.stamp_ns) / NS
        before, noise = self.state, self._noise
        fading, drift_fading = math.exp(-duration_s / noise.autopilot_s), math.exp(-duration_s / noise.autopilot_drift_s)
        turn = rotation_matrix(rates * duration_s)
        transition, step = np.eye(TERMS), UNIT * duration_s
        moved = before.rotation * -duration_s
        transition[ATTITUDE, ATTITUDE] = turn.T
        transition[ATTITUDE, GYRO_BIAS] = -step
        transition[VELOCITY, ATTITUDE] = moved @ cross_matrix(force)
        transition[VELOCITY, ACCEL_BIAS] = moved
        transition[POSITION, VELOCITY] = step
        transition[AUTOPILOT, AUTOPILOT] = UNIT * fading
        transition[DRIFT, DRIFT] = UNIT * drift_fading
        tilt, heading = noise.autopilot_tilt_rad**2 * (1.0 - fading**2), noise.autopilot_heading_rad**2 * (1.0 - fading**2)
        drift = noise.autopilot_drift**2 * (1.0 - drift_fading**2)
        growth = [density * density * duration_s for density in densities for _ in range(3)] + [tilt, tilt, heading, drift, drift, drift]
        covariance = transition @ self.covariance @ transition.T
        covariance.flat[:: TERMS + 1] += growth
        self.covariance = covariance
        self.state = InertialState(
            before.rotation @ turn,
            before.velocity + acceleration * duration_s,
            before.position + before.velocity * duration_s + 0.5 * acceleration * duration_s**2,
            before.gyro_bias,
            before.accel_bias,
            before.autopilot_error * fading,
            before.autopilot_drift * drift_fading,
        )
        self.stamp_ns = stamp_ns
        self.history.append((stamp_ns, self.state))


def rotation_matrix(vector: Floats) -> Floats:
    """Return the matrix (3, 3) of a rotation vector (3,), radians; gtsam takes a tenth of scipy's time for a single one."""
    return np.asarray(gtsam.Rot3.Expmap(vector).matrix(), dtype=np.float64)


def rotation_vector(matrix: Floats) -> Floats:
    """Return the rotation vector (3,), radians, of a matrix (3, 3)."""
    return np.asarray(gtsam.Rot3.Logmap(gtsam.Rot3(matrix)), dtype=np.float64)


def quaternion_xyzw(matrix: Floats) -> tuple[float, float, float, float]:
    """Return the unit quaternion of a matrix (3, 3)."""
    q = gtsam.Rot3(matrix).toQuaternion()
    return float(q.x()), float(q.y()), float(q.z()), float(q.w())


def cross_matrix(v: Floats) -> Floats:
    """Return the matrix that multiplies as ``v`` crossed with."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
