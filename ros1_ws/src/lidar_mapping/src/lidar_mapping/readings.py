"""Inertial readings that wait for their sweep; what can't be one is left out."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from threading import Condition
from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.inertial import ImuReading
from lidar_mapping.odometry import IMU_GAP_NS
from perception_core import NS

if TYPE_CHECKING:
    from numpy.typing import NDArray

KEPT = 2000
FASTEST_RAD_S, STRONGEST_M_S2 = 70.0, 320.0  # 4000 degrees/s and 32 g: beyond the range of what flies on a drone
WEAKEST_M_S2, WEAKEST_S = 3.0, 1.0  # the mean over so long: nothing that flies falls on; a driver that counts in g tells of 1.0
AHEAD_NS = NS  # of the clock, which a busy machine hears late; a reading of the future would hold back all after it
SET_BACK_NS = NS  # a stamp earlier by more tells of a clock that was set back


class ReadingQueue:
    """Readings in the order of their stamps, the newest `KEPT`; one thread adds, one takes."""

    def __init__(self) -> None:
        self._readings: deque[ImuReading] = deque(maxlen=KEPT)
        self._last_ns = -1
        self._taken: ImuReading | None = None
        self._heard_ns, self._mean_m_s2 = -NS, 0.0
        self._arrived = Condition()
        self._silent = False
        """The last wait was in vain, and nothing has come since."""

    def add(self, reading: ImuReading, now_ns: int) -> bool:
        """Add a reading that has just arrived; return whether it is plausible.

        A plausible reading is of now, later than the last one, and within an IMU's range, while the mean specific force is a weight's.
        """
        if not _within(reading.rates, FASTEST_RAD_S) or not _within(reading.specific_force, STRONGEST_M_S2):
            return False
        if reading.stamp_ns < self._last_ns - SET_BACK_NS:
            self.clear()
        if not self._last_ns < reading.stamp_ns <= now_ns + AHEAD_NS:
            return False
        if self._mean_force(reading) < WEAKEST_M_S2:
            return False
        self._readings.append(reading)
        with self._arrived:
            self._last_ns, self._silent = reading.stamp_ns, False
            self._arrived.notify_all()
        return True

    def _mean_force(self, reading: ImuReading) -> float:
        """Return the mean of the specific force's strength over the last `WEAKEST_S`, m/s2."""
        strength = float(np.linalg.norm(reading.specific_force))
        passed_s = (reading.stamp_ns - self._heard_ns) / NS
        fading = np.exp(-passed_s / WEAKEST_S) if 0.0 < passed_s < WEAKEST_S else 0.0
        self._heard_ns, self._mean_m_s2 = reading.stamp_ns, float(fading * self._mean_m_s2 + (1.0 - fading) * strength)
        return self._mean_m_s2

    def wait_for(self, stamp_ns: int, timeout_s: float) -> None:
        """Wait (wall clock) until the readings reach a moment; not where the last wait was in vain and none has come since."""
        with self._arrived:
            if not self._silent:
                self._silent = not self._arrived.wait_for(lambda: self._last_ns >= stamp_ns, timeout_s)

    def take_until(self, stamp_ns: int) -> list[ImuReading]:
        """Remove and return the readings up to a moment; later ones stay for the next sweep.

        The last one is what the readings around that moment make of it: without it the points at the end of each sweep would not be
        straightened.
        """
        taken: list[ImuReading] = []
        while self._readings and self._readings[0].stamp_ns <= stamp_ns:
            taken.append(self._readings.popleft())
        self._taken = taken[-1] if taken else self._taken
        if self._readings and self._readings[0].stamp_ns - stamp_ns < IMU_GAP_NS:
            taken.append(_between(self._taken, self._readings[0], stamp_ns))
        return taken

    def clear(self) -> None:
        """Forget all readings, also which was the last."""
        self._readings.clear()
        self._last_ns, self._taken = -1, None


def _between(before: ImuReading | None, after: ImuReading, stamp_ns: int) -> ImuReading:
    """Return the reading of a moment between two, or the later one where the one before is missing or too old."""
    if before is None or not 0 < after.stamp_ns - before.stamp_ns <= IMU_GAP_NS:
        return replace(after, stamp_ns=stamp_ns)
    share = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    rates = (1.0 - share) * before.rates + share * after.rates
    return ImuReading(stamp_ns, rates, (1.0 - share) * before.specific_force + share * after.specific_force)


def _within(vector: NDArray[np.float64], limit: float) -> bool:
    return bool(np.all(np.abs(vector) <= limit))
