"""The parameters that this autopilot has; names, units and meaning are ArduCopter's, every value a float as on the link."""

from __future__ import annotations

from collections.abc import Mapping

from alula.common.located_yaml import choices
from uav_simulator.errors import ConfigError

DEFAULTS: dict[str, float] = {
    "ATC_SLEW_YAW": 6000.0,  # cdeg/s
    "DISARM_DELAY": 10.0,  # s on the ground
    "FENCE_ACTION": 1.0,  # when it is breached 1: RTL, 4: BRAKE
    "FENCE_ALT_MAX": 100.0,  # m above home
    "FENCE_ENABLE": 0.0,  # 1: it counts
    "FENCE_RADIUS": 300.0,  # m around home
    "FS_GCS_ENABLE": 0.0,  # 1: RTL when the ground station falls silent
    "FS_GCS_TIMEOUT": 5.0,  # s
    "FS_THR_ENABLE": 1.0,  # 1: RTL when the remote control is lost
    "GUID_TIMEOUT": 3.0,  # s after which a velocity setpoint expires
    "LAND_SPEED": 50.0,  # cm/s below 10 m
    "LOIT_SPEED": 1250.0,  # cm/s at full stick
    "PILOT_SPEED_UP": 250.0,  # cm/s at full stick, down alike
    "PILOT_Y_RATE": 202.5,  # deg/s at full stick
    "PSC_JERK_XY": 5.0,  # m/s3
    "PSC_JERK_Z": 10.0,  # m/s3
    "RC_OVERRIDE_TIME": 3.0,  # s after which a ground station's sticks count no more
    "RTL_ALT": 1500.0,  # cm above home
    "RTL_LOIT_TIME": 5000.0,  # ms above home
    "SYSID_MYGCS": 255.0,
    "WPNAV_ACCEL": 250.0,  # cm/s2
    "WPNAV_ACCEL_Z": 250.0,  # cm/s2
    "WPNAV_SPEED": 500.0,  # cm/s
    "WPNAV_SPEED_DN": 150.0,  # cm/s
    "WPNAV_SPEED_UP": 200.0,  # cm/s
    "WP_YAW_BEHAVIOR": 2.0,  # 0: never turn the nose by itself
}


def parse_parameters(text: str) -> dict[str, float]:
    """Read ``NAME=VALUE,...``, for example ``FS_GCS_ENABLE=1``; raises ConfigError naming the wrong word."""
    values = {}
    for word in (w.strip() for w in text.split(",") if w.strip()):
        name, _, value = word.partition("=")
        if name not in DEFAULTS:
            raise ConfigError(f"autopilot parameter {word!r}: there is no {name!r}; there are {choices(name, DEFAULTS)}")
        try:
            values[name] = float(value)
        except ValueError:
            raise ConfigError(f"autopilot parameter {word!r}: {value!r} is no number") from None
    return values


class Parameters:
    """Named floats in the order of their names."""

    def __init__(self, changes: Mapping[str, float] | None = None) -> None:
        self._values = DEFAULTS | dict(changes or {})
        self.names = tuple(sorted(self._values))

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def set(self, name: str, value: float) -> None:
        """Change a parameter that exists; raises KeyError otherwise."""
        if name not in self._values:
            raise KeyError(name)
        self._values[name] = value
