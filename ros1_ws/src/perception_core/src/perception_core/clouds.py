"""Point clouds of all common LiDAR drivers to sweeps; no ROS, a message is what has its attributes.

Times of the points, as the drivers of these makers name and count them (each is found by name, its unit by its size):

- Velodyne: ``time``, float32 seconds from the stamp, often negative; Ouster: ``t``, uint32 nanoseconds from the first;
- Livox: ``offset_time``, uint32 nanoseconds from the first, or ``timestamp``, float64 nanoseconds since 1970;
- Hesai and RoboSense: ``timestamp``, float64 seconds since 1970; Luminar: ``time_sec`` and ``time_nsec`` since 1970.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from perception_core.poses import NS
from perception_core.sweep import Sweep

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# sensor_msgs/PointField
DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
TIME_NAMES = ("time", "t", "timestamp", "offset_time", "time_stamp", "time_offset", "timeOffset", "point_time")
UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)
SHORTEST_SWEEP_S, LONGEST_SWEEP_S = 0.005, 1.0
ABSOLUTE_FROM_S = 60.0  # less is counted from the sweep, not from 1970 or from the clock's start
MAX_POINTS = 10_000_000


class FieldLike(Protocol):
    """What is read of a sensor_msgs/PointField."""

    name: str
    offset: int
    datatype: int


class StampLike(Protocol):
    """A stamp."""

    def to_nsec(self) -> int:
        """Return integer nanoseconds."""


class HeaderLike(Protocol):
    """A header."""

    stamp: StampLike


class CloudLike(Protocol):
    """What is read of a sensor_msgs/PointCloud2."""

    header: HeaderLike
    height: int
    width: int
    fields: Sequence[FieldLike]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: bytes


@dataclass(frozen=True)
class _Table:
    """The cloud's bytes as one strided array a field, (height, width) each."""

    message: CloudLike

    def column(self, name: str) -> NDArray[np.float64]:
        """Return the values of a field, (N,), in the type of the field."""
        message = self.message
        field = next(field for field in message.fields if field.name == name)
        dtype = np.dtype((">" if message.is_bigendian else "<") + DATATYPES[field.datatype])
        shape, strides = (message.height, message.width), (_row_step(message), message.point_step)
        values: NDArray[np.float64] = np.ndarray(shape, dtype, message.data, field.offset, strides)
        return values.reshape(-1)


def sweep_of_cloud(message: CloudLike) -> Sweep:
    """Return the cloud's points and times as a sweep; without a field of times all points are of the stamp.

    Raises ValueError without x, y, z, for less data than promised, and for times that can't be those of one sweep. Points that are not
    finite stay in; ``Sweep.within`` drops them together with their times.
    """
    names = [field.name for field in message.fields if field.datatype in DATATYPES]
    if not {"x", "y", "z"} <= set(names):
        raise ValueError(f"the cloud has the fields {sorted(names)}, expected x, y, z")
    stamp_ns = message.header.stamp.to_nsec()
    if message.width * message.height == 0:
        return Sweep(stamp_ns=stamp_ns, points=np.empty((0, 3), np.float32), times_s=np.empty(0, np.float32))
    _check_size(message)
    table = _Table(message)
    points = np.empty((message.width * message.height, 3), dtype=np.float32)
    for axis, name in enumerate("xyz"):
        points[:, axis] = table.column(name)
    return Sweep(stamp_ns=stamp_ns, points=points, times_s=_times_s(table, stamp_ns))


def time_field(fields: Sequence[FieldLike]) -> str:
    """Return the name of the field that tells each point's time, or an empty text."""
    names = [field.name for field in fields if field.datatype in DATATYPES]
    if {"time_sec", "time_nsec"} <= set(names):
        return "time_sec"
    return next((name for name in TIME_NAMES if name in names), "")


def _row_step(message: CloudLike) -> int:
    """Return the bytes from row to row; 0 is what careless drivers write for a cloud of one row."""
    return message.row_step if message.height > 1 and message.row_step else message.width * message.point_step


def _check_size(message: CloudLike) -> None:
    used = max(field.offset + np.dtype(DATATYPES[field.datatype]).itemsize for field in message.fields if field.datatype in DATATYPES)
    row = message.width * message.point_step
    count = message.width * message.height
    if used > message.point_step or _row_step(message) < row or count > MAX_POINTS:
        raise ValueError(f"fields of {used} bytes in points of {message.point_step}, {message.width} in rows of {message.row_step}")
    if len(message.data) < (message.height - 1) * _row_step(message) + row:
        raise ValueError(f"{len(message.data)} bytes for {count} points of {message.point_step}")


def _times_s(table: _Table, stamp_ns: int) -> NDArray[np.float32]:
    name = time_field(table.message.fields)
    if not name:
        return np.zeros(table.message.width * table.message.height, dtype=np.float32)
    if name == "time_sec":
        seconds = table.column("time_sec").astype(np.int64) - stamp_ns // NS
        return _checked(seconds + table.column("time_nsec") / NS - stamp_ns % NS / NS, name)
    raw = table.column(name)
    known = raw[np.isfinite(raw) & np.any([table.column(axis) != 0 for axis in "xyz"], axis=0)]
    if not len(known):
        return np.full(len(raw), np.nan, dtype=np.float32)
    first, last = float(known.min()), float(known.max())
    for unit in UNITS_S:
        if first * unit > ABSOLUTE_FROM_S and abs(first * unit - stamp_ns / NS) < LONGEST_SWEEP_S:
            return _checked((raw - stamp_ns / NS / unit) * unit, name)
    unit = _unit_s(last - first, raw.dtype)
    # A clock that has nothing to do with the stamp's (seconds since the sensor was switched on): the stamp is the first point's.
    origin = first if abs(first) * unit > LONGEST_SWEEP_S else 0.0
    return _checked((raw - raw.dtype.type(origin)) * unit, name)


def _unit_s(span: float, dtype: np.dtype[np.float64]) -> float:
    """Return the unit in which the span is that of a sweep; where several or none fit, floats are seconds and integers nanoseconds."""
    usual = 1.0 if dtype.kind == "f" else 1e-9
    fitting = [unit for unit in UNITS_S if SHORTEST_SWEEP_S <= span * unit <= LONGEST_SWEEP_S]
    return usual if usual in fitting or not fitting else fitting[0]


def _checked(times_s: NDArray[np.float64], name: str) -> NDArray[np.float32]:
    finite = times_s[np.isfinite(times_s)]
    if len(finite) and np.ptp(finite) > LONGEST_SWEEP_S:
        # Points without a return often have no time either: let the bulk decide.
        low, high = np.percentile(finite, (1.0, 99.0))
        if high - low > LONGEST_SWEEP_S:
            raise ValueError(f"the times of the points ({name}) spread over {np.ptp(finite):.3g} s: no sweep takes as long")
        times_s = np.where((times_s >= low - LONGEST_SWEEP_S) & (times_s <= high + LONGEST_SWEEP_S), times_s, np.nan)
    return times_s.astype(np.float32)
