"""Where the vehicle was at a moment: a short memory of poses, interpolated."""

from __future__ import annotations

import math
import operator
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass
from threading import Condition
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

NS = 1_000_000_000
LEAST_ANGLE = 1e-6  # between two unit quaternions; nearer ones are interpolated linearly

_Row = tuple[float, float, float, float, float, float, float]
"""A position, and a unit quaternion x, y, z, w."""


class PoseUnavailableError(LookupError):
    """No pose is known near enough to the requested moment."""


@dataclass(frozen=True)
class Poses:
    """K poses of the vehicle in the map: ``rotation`` (K, 3, 3) base_link to map, ``position`` (K, 3) in metres."""

    rotation: NDArray[np.float64]
    position: NDArray[np.float64]

    def matrix(self, index: int = 0) -> NDArray[np.float64]:
        """Return one pose as T_map_base, (4, 4)."""
        transform = np.eye(4)
        transform[:3, :3] = self.rotation[index]
        transform[:3, 3] = self.position[index]
        return transform


class PoseBuffer:
    """Remember the last seconds of poses; thread-safe.

    Between two poses the position is interpolated linearly and the attitude on the great arc. Outside of what is known the
    nearest pose is taken, but only up to ``tolerance_s`` away from it: a vehicle at 1.5 m/s moves 0.2 m in 0.15 s.
    """

    def __init__(self, *, keep_s: float = 3.0, tolerance_s: float = 0.15) -> None:
        self._keep_ns = int(keep_s * NS)
        self._tolerance_ns = int(tolerance_s * NS)
        self._rows: deque[tuple[int, _Row]] = deque()
        self._lock = Condition()

    def add(self, stamp_ns: int, position_m: Sequence[float], quat_xyzw: Sequence[float]) -> None:
        """Remember a pose; time that jumps backwards (a restarted clock) clears the memory. One with numbers that are none is left out."""
        if not all(map(math.isfinite, (*position_m, *quat_xyzw))) or not any(quat_xyzw):
            return
        (x, y, z), (qx, qy, qz, qw), length = position_m, quat_xyzw, math.hypot(*quat_xyzw)
        row = (x, y, z, qx / length, qy / length, qz / length, qw / length)
        with self._lock:
            if self._rows and stamp_ns <= self._rows[-1][0]:
                self._rows.clear()
            self._rows.append((stamp_ns, row))
            while self._rows[0][0] < stamp_ns - self._keep_ns:
                self._rows.popleft()
            self._lock.notify_all()

    def wait_for(self, stamp_ns: int, *, timeout_s: float) -> bool:
        """Wait until a pose of this moment or later is known, at most ``timeout_s`` of wall clock; return whether it is.

        A measurement and the pose of its moment come on different ways: without the wait, the pose before it would have to do.
        """
        with self._lock:
            return self._lock.wait_for(lambda: bool(self._rows) and self._rows[-1][0] >= stamp_ns, timeout=timeout_s)

    def at(self, stamps_ns: Sequence[int], *, tolerance_s: float | None = None) -> Poses:
        """Return the poses at these moments, in any order; raise PoseUnavailableError when one of them is out of reach.

        ``tolerance_s`` in place of the buffer's own, where a pose that is a little older would mislead.
        """
        with self._lock:
            rows = list(self._rows)
        if not rows:
            raise PoseUnavailableError("no pose was received yet: is the guidance running?")
        tolerance_ns = self._tolerance_ns if tolerance_s is None else int(tolerance_s * NS)
        known_ns, values = zip(*rows, strict=True)
        _check_reach(min(stamps_ns), max(stamps_ns), known_ns[0], known_ns[-1], tolerance_ns)
        # By plain numbers: for the dozen moments of a sweep numpy takes several times as long.
        found = [values[0] if len(rows) == 1 else _interpolated(known_ns, values, int(stamp_ns)) for stamp_ns in stamps_ns]
        return Poses(rotation=np.array([rotation_of(*row[3:]) for row in found]), position=np.array([row[:3] for row in found]))


def _check_reach(first_ns: int, last_ns: int, oldest_ns: int, newest_ns: int, tolerance_ns: int) -> None:
    gap_ns = max(oldest_ns - first_ns, last_ns - newest_ns)
    if gap_ns > tolerance_ns:
        raise PoseUnavailableError(f"the nearest known pose is {gap_ns / NS:.2f} s away, more than {tolerance_ns / NS:.2f} s")


def _interpolated(stamps_ns: Sequence[int], rows: Sequence[_Row], wanted_ns: int) -> _Row:
    """Return the position and the unit quaternion of a moment; beyond what is known those of the nearest end."""
    later = min(max(bisect_right(stamps_ns, wanted_ns), 1), len(rows) - 1)
    before_ns, after_ns = stamps_ns[later - 1], stamps_ns[later]
    share = min(max((wanted_ns - before_ns) / max(after_ns - before_ns, 1), 0.0), 1.0)
    (x, y, z, *first), (next_x, next_y, next_z, *second) = rows[later - 1], rows[later]
    cosine = sum(map(operator.mul, first, second))
    angle = math.acos(min(abs(cosine), 1.0))
    of_first, of_second = 1.0 - share, share
    if angle >= LEAST_ANGLE:
        of_first, of_second = (math.sin(part * angle) / math.sin(angle) for part in (of_first, of_second))
    of_second = math.copysign(of_second, cosine)
    qx, qy, qz, qw = (of_first * a + of_second * b for a, b in zip(first, second, strict=True))
    return (x + share * (next_x - x), y + share * (next_y - y), z + share * (next_z - z), qx, qy, qz, qw)


def rotation_of(x: float, y: float, z: float, w: float) -> list[list[float]]:
    """Return the rows of the rotation matrix of a unit quaternion."""
    return [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
