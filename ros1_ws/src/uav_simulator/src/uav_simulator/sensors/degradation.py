"""What broken sensors measure: pure functions from good measurements to those of a sensor that fails in a certain way."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_simulator.sensors.faults import SensorMode
from uav_simulator.sensors.imu import ImuReading
from uav_simulator.sensors.mounts import LIDAR

Image = NDArray[np.uint8]
Pair = tuple[Image, Image]
Points = NDArray[np.void]
Rng = np.random.Generator

DARK_GAIN, DARK_NOISE = 0.01, 2.5  # of the light; grey values
WHITE_GAIN, WHITE_OFFSET = 2.0, 220.0
BLUR_PX = 8.0
SHIFT_PX = 3
TURN_DEG = 1.0
KEPT_POINTS = 500  # one of so many
RANGE_BIAS_M = 0.5
GYRO_BIAS_RAD_S = (0.05, -0.04, 0.06)
FORCE_BIAS_M_S2 = (0.6, -0.5, 0.4)
LATE_NS = 500_000_000
FUTURE_NS = 10_000_000_000


def pair(mode: SensorMode, images: Pair, rng: Rng) -> Pair:
    """Return the pair of images of a camera in a mode."""
    change = _PAIRS.get(mode)
    return images if change is None else change(images, rng)


def sweep(mode: SensorMode, points: Points, rng: Rng) -> Points:
    """Return the points of a LiDAR in a mode; they are in its own frame."""
    change = _SWEEPS.get(mode)
    return points if change is None else change(points, rng)


def inertial(mode: SensorMode, reading: ImuReading, rng: Rng) -> ImuReading:
    """Return the reading of an IMU in a mode."""
    if mode is SensorMode.BLACK:
        return ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    if mode is SensorMode.BIASED:
        return ImuReading(_sum(reading.rates, GYRO_BIAS_RAD_S), _sum(reading.specific_force, FORCE_BIAS_M_S2))
    if mode is SensorMode.FLICKERING:
        return ImuReading(_sum(reading.rates, (float(rng.normal(0.0, 0.01)), 0.0, 0.0)), reading.specific_force)
    return reading


def _sum(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


# --- images ------------------------------------------------------------------------------------------------------------------


def _black(images: Pair, _rng: Rng) -> Pair:
    return np.zeros_like(images[0]), np.zeros_like(images[1])


def _dark(images: Pair, rng: Rng) -> Pair:
    left, right = (_exposed(eye, DARK_GAIN, rng.normal(DARK_NOISE, DARK_NOISE, eye.shape)) for eye in images)
    return left, right


def _white(images: Pair, _rng: Rng) -> Pair:
    left, right = (_exposed(eye, WHITE_GAIN, np.full(eye.shape, WHITE_OFFSET)) for eye in images)
    return left, right


def _exposed(eye: Image, gain: float, offset: NDArray[np.float64]) -> Image:
    exposed: Image = np.clip(gain * eye + offset, 0.0, 255.0).astype(np.uint8)
    return exposed


def _blurred(images: Pair, _rng: Rng) -> Pair:
    left, right = (np.asarray(cv2.GaussianBlur(eye, (0, 0), BLUR_PX), dtype=np.uint8) for eye in images)
    return left, right


def _shifted(images: Pair, _rng: Rng) -> Pair:
    return images[0], np.roll(images[1], SHIFT_PX, axis=0)


def _rotated(images: Pair, _rng: Rng) -> Pair:
    left, right = images
    height, width = right.shape
    turn = cv2.getRotationMatrix2D(((width - 1) / 2.0, (height - 1) / 2.0), TURN_DEG, 1.0)
    return left, np.asarray(cv2.warpAffine(right, turn, (width, height), borderMode=cv2.BORDER_REPLICATE), dtype=np.uint8)


def _swapped(images: Pair, _rng: Rng) -> Pair:
    return images[1], images[0]


def _flickering_pair(images: Pair, rng: Rng) -> Pair:
    left = images[0].copy()
    left[0, 0] = rng.integers(0, 256)
    return left, images[1]


_PAIRS: dict[SensorMode, Callable[[Pair, Rng], Pair]] = {
    SensorMode.BLACK: _black,
    SensorMode.DARK: _dark,
    SensorMode.WHITE: _white,
    SensorMode.BLURRED: _blurred,
    SensorMode.SHIFTED: _shifted,
    SensorMode.ROTATED: _rotated,
    SensorMode.SWAPPED: _swapped,
    SensorMode.FLICKERING: _flickering_pair,
}


# --- clouds ------------------------------------------------------------------------------------------------------------------


def _empty(points: Points, _rng: Rng) -> Points:
    return points[:0]


def _thinned(points: Points, rng: Rng) -> Points:
    return points[int(rng.integers(KEPT_POINTS)) :: KEPT_POINTS]


def _without_front(points: Points, _rng: Rng) -> Points:
    forward = LIDAR.matrix[0]  # x of the body, seen from the sensor
    ahead = sum(points[axis] * part for axis, part in zip(("x", "y", "z"), forward, strict=True))
    return points[np.asarray(ahead) < 0.0]


def _too_far(points: Points, _rng: Rng) -> Points:
    biased = points.copy()
    ranges = np.sqrt(sum(points[axis] ** 2 for axis in ("x", "y", "z")))
    for axis in ("x", "y", "z"):
        biased[axis] *= 1.0 + RANGE_BIAS_M / np.maximum(ranges, 1e-3)
    return biased


def _flickering_sweep(points: Points, rng: Rng) -> Points:
    flickering = points.copy()
    if len(points):
        flickering["intensity"][0] = rng.uniform(0.0, 255.0)
    return flickering


_SWEEPS: dict[SensorMode, Callable[[Points, Rng], Points]] = {
    SensorMode.BLACK: _empty,
    SensorMode.THINNED: _thinned,
    SensorMode.SECTOR: _without_front,
    SensorMode.BIASED: _too_far,
    SensorMode.FLICKERING: _flickering_sweep,
}
