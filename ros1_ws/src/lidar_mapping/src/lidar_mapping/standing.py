"""The gyro's bias, learned while the vehicle stands: an IMU inside a LiDAR is seldom calibrated when it is switched on.

The data sheet of the Bosch BMI088 allows an offset of 1 degree/s (0.017 rad/s). What is left after a stand, and what changes in flight, the
filter estimates.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from lidar_mapping.odometry import IMU_GAP_NS
from perception_core import NS, PoseUnavailableError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from lidar_mapping.inertial import ImuReading
    from perception_core import PoseBuffer

    Floats = NDArray[np.float64]

WINDOW_NS = 2 * NS
BLOCKS = 20  # of a window; vibration averages out within one, the motion of a vehicle that is held or hovers does not
LEAST_READINGS = 2 * BLOCKS
STEADY_RAD_S = 0.003  # standard deviation of the blocks' means; white noise of 0.0005 rad/s per root hertz makes 0.0016 of it
STANDS_M, STANDS_RAD = 0.05, 0.02  # moved and turned over a window, as the autopilot says
KNOWN_RAD_S = 0.0005  # how well a stand tells the bias: white noise of 0.0005 rad/s per root hertz makes 0.00035 of it within a window
WARMS_RAD_S2 = 1e-5  # by how much the bias changes in a second after it: 10 K within 260 s, 0.26 mrad/s a kelvin (Bosch BMI088)


class StandingGyro:
    """Receives every reading, in or out of use; ``bias`` (3,) is in rad/s about the body's axes, zero until the vehicle has stood once."""

    def __init__(self) -> None:
        self.bias: Floats = np.zeros(3)
        self._stood: tuple[int, float] = (0, math.inf)  # until when, ns, and how well that told the bias, rad/s
        self._window: list[ImuReading] = []

    def add(self, reading: ImuReading, poses: PoseBuffer) -> None:
        """Add a reading; by ``poses``, the autopilot's, it is judged at the end of each window whether the vehicle has stood."""
        if self._window and not 0 < reading.stamp_ns - self._window[-1].stamp_ns <= IMU_GAP_NS:
            self._window.clear()
        self._window.append(reading)
        if reading.stamp_ns - self._window[0].stamp_ns >= WINDOW_NS:
            window, self._window = self._window, []
            self._learn(window, poses)

    def sigma_rad_s(self, stamp_ns: int) -> float:
        """Return the standard deviation of the bias about each axis at a moment; infinite while the vehicle has not stood yet.

        What the vehicle may have turned in the stand, as the autopilot says, is taken for the bias too.
        """
        until_ns, known_rad_s = self._stood
        return known_rad_s + WARMS_RAD_S2 * abs(stamp_ns - until_ns) / NS

    def _learn(self, window: list[ImuReading], poses: PoseBuffer) -> None:
        rates = np.array([reading.rates for reading in window])
        if len(rates) < LEAST_READINGS:
            return
        means = np.array([block.mean(axis=0) for block in np.array_split(rates, BLOCKS)])
        if means.std(axis=0).max() > STEADY_RAD_S:
            return
        try:
            ends = poses.at([window[0].stamp_ns, window[-1].stamp_ns])
        except PoseUnavailableError:
            return
        turn = Rotation.from_matrix(ends.rotation[0].T @ ends.rotation[1]).magnitude()
        if np.linalg.norm(ends.position[1] - ends.position[0]) < STANDS_M and turn < STANDS_RAD:
            last_ns = window[-1].stamp_ns
            self.bias, self._stood = rates.mean(axis=0), (last_ns, KNOWN_RAD_S + float(turn) * NS / (last_ns - window[0].stamp_ns))
