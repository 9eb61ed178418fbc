"""Point clouds of all common LiDAR drivers to sweeps; no ROS, a message is what has its attributes.

Times of the points, as the drivers of these makers name and count them (each is found by name, its unit by its size):

- Velodyne: ``time``, float32 seconds from the stamp, often negative; Ouster: ``t``, uint32 nanoseconds from the first;
- Livox: ``offset_time``, uint32 nanoseconds from the first, or ``timestamp``, float64 nanoseconds since 1970;
- Hesai and RoboSense: ``timestamp``, float64 seconds since 1970; Aeva: ``time_offset_ns``, int32; Luminar: ``time_sec`` and ``time_nsec``
  since 1970. Other drivers' names are known by what they contain: ``time``, ``stamp``, or seconds and nanoseconds apart.
"""

from __future__ import annotations

import re
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
TIME_NAMES = ("time", "t", "timestamp")  # in this order, before any other name of a time
OTHER_TIME = re.compile(r".*(time|stamp).*|ts|dt", re.IGNORECASE)
SECONDS = re.compile(r"(.*?)_?s(ec(ond)?s?)?", re.IGNORECASE)
NANOSECONDS = re.compile(r"(.*?)_?(ns|n(ano)?sec(ond)?s?)", re.IGNORECASE)
UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)
SHORTEST_SWEEP_S, LONGEST_SWEEP_S = 0.005, 1.0
ABSOLUTE_FROM_S = 60.0  # less is counted from the sweep, not from 1970 or from the clock's start
COUNTER_BYTES, COUNTER = 4, 2.0**32
MAX_POINTS = 10_000_000


class FieldLike(Protocol):
    """What is read of a sensor_msgs/PointField."""

    name: str
    offset: int
    datatype: int


class StampLike(Protocol):
    """What is needed of a message's stamp."""

    def to_nsec(self) -> int:
        """Return the stamp as integer nanoseconds of mission clock."""


class HeaderLike(Protocol):
    """What is needed of a message's header."""

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
    return Sweep(stamp_ns=stamp_ns, points=points, times_s=_times_s(table, points, stamp_ns))


def time_fields(fields: Sequence[FieldLike]) -> tuple[str, ...]:
    """Return the names of the fields with each point's time: one, or that of the seconds and that of the nanoseconds, or none."""
    names = [field.name for field in fields if field.datatype in DATATYPES]
    for name in names:
        nano = NANOSECONDS.fullmatch(name)
        whole = [each for each in names if nano and (found := SECONDS.fullmatch(each)) and found[1] == nano[1] and each != name]
        if whole:
            return whole[0], name
    known = [name for name in TIME_NAMES if name in names] + [name for name in names if OTHER_TIME.fullmatch(name)]
    return tuple(known[:1])


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


def _times_s(table: _Table, points: NDArray[np.float32], stamp_ns: int) -> NDArray[np.float32]:
    names = time_fields(table.message.fields)
    if not names:
        return np.zeros(len(points), dtype=np.float32)
    if len(names) > 1:
        seconds = table.column(names[0]).astype(np.int64) - stamp_ns // NS
        return _checked(seconds + table.column(names[1]) / NS - stamp_ns % NS / NS, points, names[0])
    name, raw = names[0], table.column(names[0])
    kind, counter = raw.dtype.kind, raw.dtype.kind == "u" and raw.dtype.itemsize == COUNTER_BYTES
    raw = raw.astype(np.float64)
    first, last = _span(raw, points)
    if np.isnan(first):
        return np.full(len(raw), np.nan, dtype=np.float32)
    for unit in UNITS_S:
        if first * unit > ABSOLUTE_FROM_S and abs(first * unit - stamp_ns / NS) < LONGEST_SWEEP_S:
            return _checked((raw - stamp_ns / NS / unit) * unit, points, name)
    if counter and last - first > COUNTER / 2:
        # A counter of nanoseconds in 32 bits overflows every 4.3 s, in this sweep, too: what is small comes after what is large.
        raw = np.where(raw < COUNTER / 2, raw + COUNTER, raw)
        first, last = _span(raw, points)
    unit = _unit_s(last - first, kind)
    # A clock that has nothing to do with the stamp's (seconds since the sensor was switched on): the stamp is the first point's.
    origin = first if abs(first) * unit > LONGEST_SWEEP_S else 0.0
    return _checked((raw - origin) * unit, points, name)


def _span(raw: NDArray[np.float64], points: NDArray[np.float32]) -> tuple[float, float]:
    """Return the first and the last time of the returns; NaN where none has one. Points without a return often have no time, or 0."""
    first, last = float(raw.min()), float(raw.max())
    if np.isfinite(first) and np.isfinite(last) and first:
        return first, last
    known = raw[np.isfinite(raw) & _returned(points)]
    return (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)


def _returned(points: NDArray[np.float32]) -> NDArray[np.bool_]:
    x, y, z = points.T
    returned: NDArray[np.bool_] = (x != 0.0) | (y != 0.0) | (z != 0.0)
    return returned


def _unit_s(span: float, kind: str) -> float:
    """Return the unit in which the span is that of a sweep; where several or none fit, floats are seconds and integers nanoseconds."""
    usual = 1.0 if kind == "f" else 1e-9
    fitting = [unit for unit in UNITS_S if SHORTEST_SWEEP_S <= span * unit <= LONGEST_SWEEP_S]
    return usual if usual in fitting or not fitting else fitting[0]


def _checked(times_s: NDArray[np.float64], points: NDArray[np.float32], name: str) -> NDArray[np.float32]:
    first, last = float(times_s.min()), float(times_s.max())
    if not last - first <= LONGEST_SWEEP_S:  # also where one is no number
        of_returns = times_s[np.isfinite(times_s) & _returned(points)]
        # Points without a return often have no time either; of the others, the bulk decides.
        low, high = np.percentile(of_returns, (1.0, 99.0)) if len(of_returns) else (0.0, 0.0)
        if high - low > LONGEST_SWEEP_S:
            raise ValueError(f"the times of the points ({name}) spread over {np.ptp(of_returns):.3g} s: no sweep takes as long")
        times_s = np.where((times_s >= low - LONGEST_SWEEP_S) & (times_s <= high + LONGEST_SWEEP_S), times_s, np.nan)
    return times_s.astype(np.float32)
