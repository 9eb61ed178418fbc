"""Measurements that fail although they did not: withheld or spoiled from a moment on, by the simulator's own kinds of failure."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
from genpy import Time

from node_core.replay import Arrival, Change, dead, frozen
from uav_simulator.sensors import degradation
from uav_simulator.sensors.faults import SensorMode

_IMAGES = (SensorMode.BLACK, SensorMode.DARK, SensorMode.WHITE, SensorMode.BLURRED)
_CLOUDS = (SensorMode.BLACK, SensorMode.THINNED, SensorMode.SECTOR, SensorMode.BIASED)


def _late(arrival: Arrival) -> Iterable[tuple[Any, int]]:
    yield arrival.message, arrival.at_ns + degradation.LATE_NS


def _future(arrival: Arrival) -> Iterable[tuple[Any, int]]:
    ahead_ns = arrival.message.header.stamp.to_nsec() + degradation.FUTURE_NS
    arrival.message.header.stamp = Time(ahead_ns // 1_000_000_000, ahead_ns % 1_000_000_000)
    yield arrival.message, arrival.at_ns


def _spoiled(mode: SensorMode, arrival: Arrival) -> Iterable[tuple[Any, int]]:
    message = arrival.message
    if arrival.topic.endswith("image_raw"):
        image = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)[:, : message.width]
        message.data = np.ascontiguousarray(degradation.pair(mode, (image, image), arrival.rng)[0]).tobytes()
        message.step = message.width
    elif arrival.topic == "/lidar/points":
        points = degradation.sweep(mode, np.frombuffer(message.data, _dtype(message)), arrival.rng)
        message.data, message.width, message.height = points.tobytes(), len(points), 1
        message.row_step = message.width * message.point_step
    yield message, arrival.at_ns


def _dtype(message: Any) -> np.dtype[np.void]:
    kinds = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}
    names, formats = [f.name for f in message.fields], [kinds[f.datatype] for f in message.fields]
    offsets = [f.offset for f in message.fields]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": message.point_step})


def _ways(*modes: SensorMode) -> dict[str, Change]:
    of_any: dict[str, Change] = {
        SensorMode.DEAD.value: dead,
        SensorMode.FROZEN.value: frozen,
        SensorMode.LATE.value: _late,
        SensorMode.FUTURE.value: _future,
    }
    return of_any | {mode.value: partial(_spoiled, mode) for mode in modes}


WAYS = {"zed": _ways(*_IMAGES), "lidar": _ways(*_CLOUDS), "imu": _ways()}
"""What can fail, each with the ways in which it can; the first one counts where none is named."""
