"""What can be set, with defaults; a parameter only overrides, and an unknown one is an error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields


class SettingsError(ValueError):
    """A parameter is unknown or its value is of no use."""


@dataclass(frozen=True)
class Settings:
    """Settings of the guidance, in metres, seconds, radians."""

    url: str = "tcp:127.0.0.1:5760"
    """MAVLink connection as pymavlink writes it: tcp:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT, /dev/ttyX."""
    baud: int = 921600
    """Of a serial port."""

    fence_radius_m: float = 60.0
    """Farthest horizontal distance of a target from home."""
    fence_height_m: float = 20.0
    """Greatest height of a target above home."""
    fence_floor_m: float = 0.5
    """Least height of a target above home."""

    max_speed_m_s: float = 5.0
    """Greatest speed that may be asked for."""
    max_accel_m_s2: float = 1.5
    """Of the carrot, and for planned braking."""
    carrot_lead_m: float = 1.0
    """The carrot keeps its speed until it is so far ahead of the vehicle ..."""
    carrot_lead_s: float = 1.25
    """... or so many seconds at the speed of the reference, if that is more: a vehicle follows moving positions about 1 s late."""

    yaw_rate_rad_s: float = 0.7
    """At which the nose is turned into the travel."""
    max_yaw_rate_rad_s: float = 1.5
    """Greatest rate that may be asked for."""
    yaw_aligned_rad: float = math.radians(10.0)
    """The vehicle moves once its nose is so close to the travel."""

    obstacle_stop_m: float = 3.0
    """An obstacle in the way nearer than this (from the vehicle's centre) makes it brake and hold."""
    obstacle_clearance_m: float = 2.0
    """It also brakes in time to stop this far off; an obstacle that stays farther than this from the target is not in the way."""
    watch_age_s: float = 0.25
    """Longer after the arrival of a sensor's last verdict nobody watches, and the vehicle brakes. Sensors send at 10 Hz."""
    obstacle_age_s: float = 0.6
    """A verdict on an older measurement does not count, even if it has just arrived."""
    obstacle_clear_s: float = 0.5
    """For so long the way must be clear before it goes on."""

    reached_m: float = 0.1
    """Nearer to the target nothing remains to be done."""
    reached_rad: float = math.radians(2.0)
    """Nearer to the heading nothing remains to be done."""

    link_lost_s: float = 2.0
    """Without heartbeat for so long the link counts as lost."""

    def lead_m(self, speed_m_s: float) -> float:
        """Return how far ahead of a vehicle that does not follow the carrot comes to rest."""
        return max(self.carrot_lead_m, self.carrot_lead_s * speed_m_s) + speed_m_s**2 / (2.0 * self.max_accel_m_s2)

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float) and not (math.isfinite(value) and value > 0.0):
                raise SettingsError(f"parameter {field.name} is {value}: it must be a positive number")

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, object]) -> Settings:
        """Make settings of a node's private parameters; SettingsError names what is wrong with them."""
        known = {field.name: type(getattr(cls, field.name)) for field in fields(cls)}
        values: dict[str, object] = {}
        for name, value in parameters.items():
            if name not in known:
                raise SettingsError(f"unknown parameter {name}; known are {', '.join(sorted(known))}")
            values[name] = _converted(name, value, known[name])
        return cls(**values)  # type: ignore[arg-type]  # each value was converted to its field's type


def _converted(name: str, value: object, kind: type) -> object:
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise SettingsError(f"parameter {name} is {value!r}: it must be of type {kind.__name__}")
    return value
