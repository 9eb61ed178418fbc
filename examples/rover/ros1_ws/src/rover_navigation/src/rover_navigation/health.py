"""Is what is measured to be believed? Judged by the signals alone; each monitor says so in a word. No ROS.

A laser's noise never repeats: a scan that equals the one before is an old one. A beam that sees the same near thing wherever the rover
is sees the rover itself, or what covers it. Wheels that slip turn without the scans agreeing; a weak motor does not turn as commanded.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SILENT_S = 0.5
REPEATED = 3  # equal scans in a row
NEAR_M, NEAR_CHANGE_M, NEAR_SHARE, NEAR_SCANS = 0.2, 0.02, 0.15, 5
WINDOW_S = 2.0
MOVED_M = 0.25  # least way by odometry within the window that can be judged
SLIP = 0.75  # part of that way that scan matching has to confirm
MISSING_RAD = 0.35  # a weak motor: the turn within the window differs so much from what was commanded
LOST, GOOD, LOST_SCANS = 0.5, 0.65, 10
STUCK_M = 0.3  # the bumper stays pressed though the rover has moved so far

OK = "OK"


class LaserMonitor:
    """Says OK, or what is wrong with the scans: SILENT, FROZEN, COVERED."""

    def __init__(self) -> None:
        self._last: NDArray[np.float64] | None = None
        self._last_s = -math.inf
        self._repeated = 0
        self._near_scans: NDArray[np.intp] | None = None

    def scan(self, ranges_m: NDArray[np.float64], now_s: float) -> None:
        """Take in a scan; ranges that are not finite hit nothing."""
        last, self._last, self._last_s = self._last, ranges_m, now_s
        if last is None or last.shape != ranges_m.shape:
            self._near_scans = np.zeros(len(ranges_m), dtype=np.intp)
            return
        self._repeated = self._repeated + 1 if np.array_equal(last, ranges_m) else 0
        with np.errstate(invalid="ignore"):
            same = (ranges_m < NEAR_M) & (np.abs(ranges_m - last) < NEAR_CHANGE_M)
        self._near_scans = np.where(same, 1 if self._near_scans is None else self._near_scans + 1, 0)

    @property
    def repeats(self) -> bool:
        """Return whether the last scan is the one before once more: it says nothing of where the rover is now."""
        return self._repeated > 0

    def verdict(self, now_s: float) -> str:
        """Return what there is to say."""
        if self._last is None:
            return ""
        if now_s - self._last_s > SILENT_S:
            return "SILENT"
        if self._repeated >= REPEATED:
            return "FROZEN"
        if self._near_scans is not None and np.mean(self._near_scans >= NEAR_SCANS) >= NEAR_SHARE:
            return "COVERED"
        return OK


class PoseMonitor:
    """Says GOOD or LOST by how much of the scans matches; LOST after ten bad scans, GOOD after ten good ones."""

    def __init__(self) -> None:
        self._recent: deque[float] = deque(maxlen=LOST_SCANS)
        self.verdict = ""

    def quality(self, share: float) -> None:
        """Take in the share of a scan's beams that match."""
        self._recent.append(share)
        if len(self._recent) == LOST_SCANS and max(self._recent) < LOST:
            self.verdict = "LOST"
        elif min(self._recent) > GOOD and (self.verdict != "LOST" or len(self._recent) == LOST_SCANS):
            self.verdict = "GOOD"


@dataclass(frozen=True)
class WheelReading:
    """A moment: where the rover is by odometry and by scan matching (metres), how it is told to turn and how its wheels turn it (rad/s)."""

    now_s: float
    odom: tuple[float, float]
    matched: tuple[float, float]
    told_rad_s: float
    turns_rad_s: float


class WheelMonitor:
    """Says OK, SLIPPING or WEAK, of the ways and turns within the last two seconds."""

    def __init__(self) -> None:
        self._readings: deque[WheelReading] = deque()
        self.verdict = OK

    def step(self, reading: WheelReading) -> None:
        """Take in a moment. What was found stays until the rover has moved enough to judge again."""
        readings = self._readings
        readings.append(reading)
        while reading.now_s - readings[0].now_s > WINDOW_S:
            readings.popleft()
        first, span_s = readings[0], reading.now_s - readings[0].now_s
        if span_s < 0.8 * WINDOW_S:
            return
        missing_rad = np.mean([one.told_rad_s - one.turns_rad_s for one in readings]) * span_s
        counted_m, matched_m = math.dist(first.odom, reading.odom), math.dist(first.matched, reading.matched)
        if abs(missing_rad) > MISSING_RAD:
            self.verdict = "WEAK"
        elif counted_m > MOVED_M:
            self.verdict = "SLIPPING" if matched_m < SLIP * counted_m else OK


class BumperMonitor:
    """Says OK, or STUCK when the bumper stays pressed though the rover has driven away."""

    def __init__(self) -> None:
        self._pressed_at: tuple[float, float] | None = None
        self.verdict = OK

    def step(self, odom: tuple[float, float], *, pressed: bool) -> None:
        """Take in what the bumper says, and where odometry has come to."""
        if not pressed:
            self._pressed_at, self.verdict = None, OK
            return
        self._pressed_at = self._pressed_at or odom
        if math.dist(self._pressed_at, odom) > STUCK_M:
            self.verdict = "STUCK"
