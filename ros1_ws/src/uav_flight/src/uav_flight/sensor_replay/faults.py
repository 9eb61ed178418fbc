"""Measurements that fail although they did not: withheld or spoiled from a moment on, by the simulator's own kinds of failure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from genpy import Time

from alula.common.faults import FaultRequest, parse_fault
from uav_simulator.sensors import degradation
from uav_simulator.sensors.faults import SensorMode

TOPICS = {
    "/zed/left/image_raw": "zed",
    "/zed/right/image_raw": "zed",
    "/zed/left/camera_info": "zed",
    "/zed/right/camera_info": "zed",
    "/lidar/points": "lidar",
    "/imu/data": "imu",
}
_ANY = (SensorMode.DEAD, SensorMode.FROZEN, SensorMode.LATE, SensorMode.FUTURE)
_IMAGES = (SensorMode.BLACK, SensorMode.DARK, SensorMode.WHITE, SensorMode.BLURRED)
_CLOUDS = (SensorMode.BLACK, SensorMode.THINNED, SensorMode.SECTOR, SensorMode.BIASED)
WAYS = {
    "zed": tuple(mode.value for mode in (*_ANY, *_IMAGES)),
    "lidar": tuple(mode.value for mode in (*_ANY, *_CLOUDS)),
    "imu": tuple(mode.value for mode in _ANY),
}
"""What can fail, each with the ways in which it can; the first one counts where none is named."""


@dataclass
class Faults:
    """What fails when; times count from lift-off, ``lift_off_ns`` of mission clock."""

    requests: Sequence[FaultRequest]
    lift_off_ns: int

    def __post_init__(self) -> None:
        self._last: dict[str, Any] = {}
        self._rng = np.random.default_rng(0)

    def arriving(self, topic: str, message: Any, stamp_ns: int) -> Iterator[tuple[Any, int]]:
        """Yield what arrives in place of a message, and when: nothing, the same, or something else."""
        mode = self._mode(TOPICS[topic], stamp_ns)
        if mode is SensorMode.OK:
            self._last[topic] = message
            yield message, stamp_ns
        elif mode is SensorMode.FROZEN and topic in self._last:
            frozen = self._last[topic]
            frozen.header.stamp = message.header.stamp
            yield frozen, stamp_ns
        elif mode is SensorMode.LATE:
            yield message, stamp_ns + degradation.LATE_NS
        elif mode is SensorMode.FUTURE:
            ahead_ns = message.header.stamp.to_nsec() + degradation.FUTURE_NS
            message.header.stamp = Time(ahead_ns // 1_000_000_000, ahead_ns % 1_000_000_000)
            yield message, stamp_ns
        elif mode is not SensorMode.DEAD:
            yield self._spoiled(topic, message, mode), stamp_ns

    def _mode(self, sensor: str, stamp_ns: int) -> SensorMode:
        mode = SensorMode.OK
        for request in self.requests:
            if request.what == sensor and request.lasts((stamp_ns - self.lift_off_ns) / 1e9):
                mode = SensorMode(request.how or WAYS[sensor][0])
        return mode

    def _spoiled(self, topic: str, message: Any, mode: SensorMode) -> Any:
        if topic.endswith("image_raw"):
            image = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)[:, : message.width]
            message.data = np.ascontiguousarray(degradation.pair(mode, (image, image), self._rng)[0]).tobytes()
            message.step = message.width
        elif topic == "/lidar/points":
            points = degradation.sweep(mode, np.frombuffer(message.data, _dtype(message)), self._rng)
            message.data, message.width, message.height = points.tobytes(), len(points), 1
            message.row_step = message.width * message.point_step
        return message


def read_faults(texts: Sequence[str]) -> list[FaultRequest]:
    """Read what is to fail; raises FaultError."""
    return [parse_fault(text, WAYS) for text in texts]


def _dtype(message: Any) -> np.dtype[np.void]:
    kinds = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}
    names, formats = [f.name for f in message.fields], [kinds[f.datatype] for f in message.fields]
    offsets = [f.offset for f in message.fields]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": message.point_step})
