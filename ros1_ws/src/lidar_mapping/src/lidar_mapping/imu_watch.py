"""Whether the IMU is of use to the mapping: readings reach each sweep in time, and change as those of a vehicle in the air do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from perception_core import NS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lidar_mapping.inertial import ImuReading

OLD_NS = NS // 10  # the newest reading before the end of a sweep; an IMU sends at 25 Hz at least
BROKEN_NS = NS  # without use for so long: the inertial prediction has lost more than registration can make up for surely


class ImuWatch:
    """Judge after each sweep; what was found stays, for an IMU that has failed once in a mapping is not relied on again."""

    def __init__(self) -> None:
        self.problem = ""
        self.still = False
        """The readings of the last sweep do not change: they are none of the motion, whether the IMU has failed or will go on."""
        self._useful_ns: int | None = None
        self._newest: ImuReading | None = None
        self._refused = 0
        self._last_refusal = ""

    def refuse(self, why: str) -> None:
        """Count an impossible reading, and store why it is one."""
        self._refused += 1
        self._last_refusal = why

    def fails(self, end_ns: int, readings: Sequence[ImuReading]) -> bool:
        """Judge the readings of a sweep, up to its end; return whether the IMU has failed just now, for a second: see ``problem``."""
        if self._useful_ns is None or end_ns < self._useful_ns:  # the first one, or a clock that was set back
            self._useful_ns, self._newest = end_ns, None
        still = self.still = bool(readings) and self._newest is not None and unchanging([self._newest, *readings])
        self._newest = readings[-1] if readings else self._newest
        late = self._newest is None or end_ns - self._newest.stamp_ns > OLD_NS
        if not late and not still:
            self._useful_ns, self._refused = end_ns, 0
        elif end_ns - self._useful_ns >= BROKEN_NS and not self.problem:
            self.problem = "its readings do not change" if still else self._missing(end_ns)
            return True
        return False

    def _missing(self, end_ns: int) -> str:
        if self._refused:
            return f"{self._refused} readings in a row can't be any: {self._last_refusal}"
        if self._newest is None or end_ns - self._newest.stamp_ns >= BROKEN_NS:
            return "no reading has come for a second"
        return f"its readings come too late: the newest is {(end_ns - self._newest.stamp_ns) / NS:.1f} s old at the end of a sweep"


def unchanging(readings: Sequence[ImuReading]) -> bool:
    """Return whether at most one of the six numbers changes from reading to reading: no sensor in a vehicle that flies is so quiet."""
    values = np.array([(*reading.rates, *reading.specific_force) for reading in readings])
    return int(np.count_nonzero(np.ptp(values, axis=0) > 0.0)) <= 1
