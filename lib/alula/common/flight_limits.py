"""What the vehicle may be asked for at most: the one place that the guidance enforces and the skills tell in advance."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FlightLimits:
    """Metres (the fence is an upright cylinder around home), metres and radians per second."""

    max_speed_m_s: float = 3.0
    max_yaw_rate_rad_s: float = 1.5
    fence_radius_m: float = 60.0
    fence_floor_m: float = 0.5
    fence_height_m: float = 20.0


FLIGHT_LIMITS = FlightLimits()
