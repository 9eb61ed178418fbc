"""Clouds as the drivers of several makers send them, and as broken ones do."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception_core import NS
from perception_core.clouds import DATATYPES, sweep_of_cloud

NUMBERS = {name: number for number, name in DATATYPES.items()}
STAMP_NS = 1_700_000_000 * NS + 250_000_000
EPOCH_S = STAMP_NS / NS


@dataclass
class Cloud:
    """A PointCloud2 without ROS."""

    fields: list[SimpleNamespace]
    data: bytes
    width: int
    point_step: int
    height: int = 1
    row_step: int = 0
    is_bigendian: bool = False
    stamp_ns: int = STAMP_NS

    @property
    def header(self) -> SimpleNamespace:
        return SimpleNamespace(stamp=SimpleNamespace(to_nsec=lambda: self.stamp_ns))


def cloud(columns, *, order="<", padding=0, height=1, row_padding=0) -> Cloud:
    """Pack columns (name, type, values) into points with ``padding`` bytes behind each, and rows with ``row_padding`` behind each."""
    dtype = np.dtype([(name, order + kind) for name, kind, _ in columns] + [("pad", f"V{padding}")])
    raw = np.zeros(len(columns[0][2]), dtype)
    for name, _, values in columns:
        raw[name] = values
    rows = [row.tobytes() + bytes(row_padding) for row in raw.reshape(height, -1)]
    fields = [SimpleNamespace(name=name, offset=dtype.fields[name][1], datatype=NUMBERS[kind]) for name, kind, _ in columns]
    row_step = len(rows[0])
    return Cloud(fields, b"".join(rows), raw.size // height, dtype.itemsize, height, row_step, order == ">")


def xyz(count=5, kind="f4"):
    return [(name, kind, np.arange(count) + 1.0 + 10 * axis) for axis, name in enumerate("xyz")]


SPAN = np.linspace(0.0, 0.1, 5)
MAKERS = {
    "velodyne": ("time", "f4", SPAN - 0.1, SPAN - 0.1),
    "velodyne from the first": ("time", "f4", SPAN, SPAN),
    "milliseconds": ("time", "f4", SPAN * 1e3, SPAN),
    "microseconds": ("time_offset", "u4", SPAN * 1e6, SPAN),
    "ouster": ("t", "u4", SPAN * 1e9, SPAN),
    "time as uint32 ns": ("time", "u4", SPAN * 1e9, SPAN),
    "livox": ("offset_time", "u4", SPAN * 1e9, SPAN),
    "livox driver 2": ("timestamp", "f8", (EPOCH_S + SPAN) * 1e9, SPAN),
    "hesai": ("timestamp", "f8", EPOCH_S + SPAN, SPAN),
    "robosense, stamped at the end": ("timestamp", "f8", EPOCH_S - 0.1 + SPAN, SPAN - 0.1),
    "time as absolute float64": ("time", "f8", EPOCH_S + SPAN, SPAN),
    "since power-up": ("timestamp", "f8", 512.25 + SPAN, SPAN),
    "ouster's clock in ns since power-up": ("t", "u4", 3.2e9 + SPAN * 1e9, SPAN),
    "a counter of ns that overflows": ("t", "u4", (2**32 - 5e7 + SPAN * 1e9) % 2**32, SPAN),
    "aeva": ("time_offset_ns", "i4", SPAN * 1e9, SPAN),
    "a name of its own": ("PointTimestamp_us", "u4", SPAN * 1e6, SPAN),
    "ts": ("ts", "f4", SPAN, SPAN),
}


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("order", ["<", ">"])
def test_times_of_the_makers(maker, order) -> None:
    name, kind, raw, expected = MAKERS[maker]
    sweep = sweep_of_cloud(cloud([*xyz(), (name, kind, raw)], order=order))
    assert sweep.times_s == pytest.approx(expected, abs=2e-6)
    assert sweep.points.tolist() == [[k + 1.0, k + 11.0, k + 21.0] for k in range(5)]
    assert abs(sweep.end_ns - STAMP_NS) <= 0.1001 * NS


@pytest.mark.parametrize(
    ("whole", "nano"), [("time_sec", "time_nsec"), ("timestampSecond", "timestampNanosecond"), ("sec", "nsec"), ("t_s", "t_ns")]
)
def test_times_in_two_fields(whole, nano) -> None:
    at_ns = STAMP_NS + (SPAN * NS).astype(np.int64)
    sweep = sweep_of_cloud(cloud([*xyz(), (nano, "u4", at_ns % NS), (whole, "u4", at_ns // NS)]))
    assert sweep.times_s == pytest.approx(SPAN, abs=2e-6)


@pytest.mark.parametrize(("name", "kind", "first"), [("t", "u4", 3.2e9), ("timestamp", "f8", 512.25), ("timestamp", "f8", EPOCH_S)])
def test_points_without_a_return_have_no_time(name, kind, first) -> None:
    span = SPAN * (1e9 if kind == "u4" else 1.0)
    returned = np.arange(20) % 4 == 0  # of an organised cloud, three of four are empty: zeros throughout
    columns = [(axis, "f4", np.where(returned, 5.0, 0.0)) for axis in "xyz"]
    times = np.zeros(20)
    times[returned] = first + span
    sweep = sweep_of_cloud(cloud([*columns, (name, kind, times)]))
    assert sweep.times_s[returned] == pytest.approx(SPAN, abs=2e-6)
    assert abs(sweep.end_ns - STAMP_NS) <= 0.1001 * NS


def test_points_without_a_time_are_dropped_with_those_without_a_place() -> None:
    times = np.array([0.0, np.nan, 0.05, np.inf, 0.1])
    columns = [("x", "f4", [2, 2, np.nan, 2, 3]), ("y", "f4", np.ones(5)), ("z", "f4", np.ones(5)), ("time", "f4", times)]
    sweep = sweep_of_cloud(cloud(columns))
    assert sweep.within(0.1, 100.0).points[:, 0].tolist() == [2.0, 3.0]
    assert sweep.end_ns == pytest.approx(STAMP_NS + NS // 10, abs=100)
    nothing = sweep_of_cloud(cloud([*xyz(), ("time", "f4", np.full(5, np.nan))]))
    assert len(nothing.within(0.1, 100.0).points) == 0
    assert nothing.end_ns == STAMP_NS


def test_rows_with_padding_organised_clouds_and_doubles() -> None:
    sweep = sweep_of_cloud(cloud(xyz(6, "f8"), padding=5, height=2, row_padding=7))
    assert sweep.points[:, 2].tolist() == [21, 22, 23, 24, 25, 26]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"data": b"\0" * 59}, "59 bytes for 5 points of 12"),
        ({"fields": []}, "expected x, y, z"),
        ({"point_step": 10}, "fields of 12 bytes in points of 10"),
        ({"height": 2, "row_step": 20}, "in rows of 20"),
        ({"width": 2**31}, "in points of 12, 2147483648"),
    ],
)
def test_clouds_that_contradict_themselves_are_refused(change, sentence) -> None:
    message = cloud(xyz())
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(ValueError, match=sentence):
        sweep_of_cloud(message)


def test_times_that_no_sweep_takes_are_refused() -> None:
    with pytest.raises(ValueError, match="spread over 4 s"):
        sweep_of_cloud(cloud([*xyz(), ("time", "f8", np.linspace(0, 4, 5))]))


def test_no_points_at_all() -> None:
    message = cloud(xyz())
    message.width, message.data = 0, b""
    assert sweep_of_cloud(message).points.shape == (0, 3)


@given(st.binary(max_size=200), st.integers(0, 2**32 - 1), st.integers(0, 5), st.integers(0, 64), st.integers(0, 400), st.booleans())
@settings(max_examples=200)
def test_garbage_is_read_or_refused(data, width, height, point_step, row_step, bigendian) -> None:
    template = cloud([*xyz(), ("time", "f8", SPAN)])
    message = Cloud(template.fields, data, width, point_step, height, row_step, bigendian)
    try:
        sweep = sweep_of_cloud(message)
    except ValueError:
        return
    assert len(sweep.points) == width * height
    assert abs(sweep.end_ns - STAMP_NS) < 2**63
