"""Where the vehicle was at a moment: a short memory of poses, interpolated."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from threading import Condition
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

NS = 1_000_000_000


class PoseUnavailableError(LookupError):
    """No pose is known near enough to the asked moment."""


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
        self._rows: deque[tuple[int, tuple[float, ...]]] = deque()
        self._lock = Condition()

    def add(self, stamp_ns: int, position_m: Sequence[float], quat_xyzw: Sequence[float]) -> None:
        """Remember a pose; time that jumps backwards (a restarted clock) clears the memory. One with numbers that are none is left out."""
        if not all(map(math.isfinite, (*position_m, *quat_xyzw))) or not any(quat_xyzw):
            return
        with self._lock:
            if self._rows and stamp_ns <= self._rows[-1][0]:
                self._rows.clear()
            self._rows.append((stamp_ns, (*position_m, *quat_xyzw)))
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
        wanted = np.asarray(stamps_ns, dtype=np.int64)
        tolerance_ns = self._tolerance_ns if tolerance_s is None else int(tolerance_s * NS)
        _check_reach(int(wanted.min()), int(wanted.max()), rows[0][0], rows[-1][0], tolerance_ns)
        known = np.array([stamp for stamp, _ in rows], dtype=np.int64)
        first = max(0, int(np.searchsorted(known, wanted.min(), side="right")) - 1)
        last = min(len(rows), int(np.searchsorted(known, wanted.max(), side="left")) + 1)
        values = np.array([row for _, row in rows[first:last]])
        return _interpolate(known[first:last], values, wanted)


def _check_reach(first_ns: int, last_ns: int, oldest_ns: int, newest_ns: int, tolerance_ns: int) -> None:
    gap_ns = max(oldest_ns - first_ns, last_ns - newest_ns)
    if gap_ns > tolerance_ns:
        raise PoseUnavailableError(f"the nearest known pose is {gap_ns / NS:.2f} s away, more than {tolerance_ns / NS:.2f} s")


def _interpolate(known_ns: NDArray[np.int64], values: NDArray[np.float64], wanted_ns: NDArray[np.int64]) -> Poses:
    known_s = (known_ns - known_ns[0]) / NS
    wanted_s = np.clip((wanted_ns - known_ns[0]) / NS, 0.0, known_s[-1])
    before = np.clip(np.searchsorted(known_s, wanted_s, side="right") - 1, 0, max(0, len(known_s) - 2))
    after = np.minimum(before + 1, len(known_s) - 1)
    share = ((wanted_s - known_s[before]) / np.maximum(known_s[after] - known_s[before], 1e-9))[:, None]
    position = values[before, :3] + share * (values[after, :3] - values[before, :3])
    quats = values[:, 3:] / np.linalg.norm(values[:, 3:], axis=1, keepdims=True)
    return Poses(rotation=_matrices(_slerp(quats[before], quats[after], share)), position=position)


def _slerp(first: NDArray[np.float64], second: NDArray[np.float64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Interpolate unit quaternions (N, 4) on the great arc; ``share`` (N, 1) is of the second."""
    cosine = np.sum(first * second, axis=1, keepdims=True)
    second = np.where(cosine < 0.0, -second, second)
    angle = np.arccos(np.minimum(np.abs(cosine), 1.0))
    near = angle < 1e-6
    sine = np.where(near, 1.0, np.sin(angle))
    weights = np.where(near, (1.0 - share, share), (np.sin((1.0 - share) * angle) / sine, np.sin(share * angle) / sine))
    mixed: NDArray[np.float64] = weights[0] * first + weights[1] * second
    return mixed


def _matrices(quats_xyzw: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z, w = quats_xyzw.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
