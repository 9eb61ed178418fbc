"""How far the simulated autopilot and sensors are from perfect: ``off`` (the default), ``realistic``, or named values.

``realistic,position_drift=0.05`` begins with the realistic values and changes one. What is drawn at random depends on the seed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

from alula.common.located_yaml import choices
from uav_simulator.errors import ConfigError


@dataclass(frozen=True)
class Imperfections:
    """Errors on top of the small ones that are always there; zero: none."""

    position_drift: float = 0.0
    """Error of the autopilot's position, metres a metre flown, in a direction that depends on the seed."""
    yaw_drift_deg: float = 0.0
    """Error of the autopilot's heading, degrees every 100 m flown."""
    yaw_walk_deg: float = 0.0
    """The autopilot's heading wanders in the air, from right to off by so much and back, once in 100 s."""
    tilt_bias_deg: float = 0.0
    """Error of the autopilot's roll and pitch, each with a sign that depends on the seed."""
    tilt_walk_deg: float = 0.0
    """Standard deviation of what comes on top of it, slowly (30 s)."""
    height_noise_m: float = 0.0
    """Standard deviation of the autopilot's height, within half a second: the barometer's noise."""
    height_drift_m: float = 0.0
    """Standard deviation of the autopilot's height, slowly (60 s): the weather."""
    height_drift_m_s: float = 0.0
    """The autopilot's height runs away in the air, up or down depending on the seed: a barometer that warms up or is blown at."""
    position_jump_m: float = 0.0
    """The autopilot's position jumps by so much, each time in another direction, ..."""
    jump_every_s: float = 20.0
    """... so often in the air."""
    wind_m_s: float = 0.0
    """The mean wind, where it is more than the 1 m/s that always blows, from a side that depends on the seed, ..."""
    gust_m_s: float = 0.0
    """... and the standard deviation of its gusts, where that is more than 0.5."""
    pixel_noise: float = 0.0
    """Standard deviation of grey values, on top of 2."""
    exposure: float = 0.0
    """The images' brightness wanders by this part, slowly; both eyes alike."""
    range_noise_m: float = 0.0
    """Standard deviation of the LiDAR's ranges, on top of 0.02."""
    gyro_bias_rad_s: float = 0.0
    """Standard deviation of each axis' constant bias, on top of 0.001."""
    accel_bias_m_s2: float = 0.0
    """Standard deviation of each axis' constant bias, on top of 0.02."""
    zed_latency_s: float = 0.0
    """From the measurement to its arrival; so for the other sensors."""
    lidar_latency_s: float = 0.0
    imu_latency_s: float = 0.0


PRESETS = {
    "off": Imperfections(),
    "realistic": Imperfections(
        position_drift=0.01,
        yaw_drift_deg=1.0,
        yaw_walk_deg=2.3,
        tilt_bias_deg=0.17,
        tilt_walk_deg=0.03,
        height_noise_m=0.005,
        height_drift_m=0.01,
        height_drift_m_s=0.004,
        position_jump_m=0.1,
        jump_every_s=30.0,
        pixel_noise=3.0,
        exposure=0.25,
        range_noise_m=0.01,
        gyro_bias_rad_s=0.003,
        accel_bias_m_s2=0.08,
        zed_latency_s=0.06,
        lidar_latency_s=0.04,
        imu_latency_s=0.004,
    ),
}
NAMES = tuple(field.name for field in fields(Imperfections))


def parse_imperfections(text: str) -> Imperfections:
    """Read ``off``, ``realistic`` or ``NAME=VALUE``, several between commas; raises ConfigError naming the wrong word."""
    found = PRESETS["off"]
    for word in (w.strip() for w in text.split(",") if w.strip()):
        name, equals, value = word.partition("=")
        if not equals and name in PRESETS:
            found = PRESETS[name]
        elif name not in NAMES or not equals:
            known = (*PRESETS, *(f"{known}=VALUE" for known in NAMES))
            raise ConfigError(f"imperfections: {word!r} is unknown; there are {choices(name, known)}")
        else:
            found = replace(found, **{name: _number(word, value)})
    return found


def _number(word: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise ConfigError(f"imperfections: {word!r}: {text!r} is no number from 0 on")
    return value
