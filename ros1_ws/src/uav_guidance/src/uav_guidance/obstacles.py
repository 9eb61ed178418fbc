"""Whether something stands in the way: the last words of each sensor, and when to go on."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_guidance.carrot import braking_distance
from uav_guidance.settings import Settings
from uav_guidance.vectors import ZERO, Vec3

LEAST_TRAVEL_M = 0.3  # the corridor is horizontal: a climb on the spot has no way ahead
ASIDE_COSINE = 0.5  # farther than 60 degrees from the travel is not ahead
BELIEVE_PLACE_M = 1.0  # the nearest point must fit the distance to be believed


@dataclass(frozen=True)
class Sighting:
    """What one sensor says about the corridor ahead; the distance is along it, from the vehicle's centre."""

    source: str
    stamp_s: float
    detected: bool
    distance_m: float
    nearest_enu_m: Vec3 = ZERO


@dataclass(frozen=True)
class Way:
    """What lies before the vehicle: the place, the way to the target, the speed towards it."""

    position_enu_m: Vec3
    remaining_enu_m: Vec3
    speed_m_s: float


class ObstacleWatch:
    """Remember the last sighting of each sensor and decide when to hold and when to go on."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._sightings: dict[str, Sighting] = {}
        self._last_in_way_s: float | None = None

    def see(self, sighting: Sighting) -> None:
        """Take a sensor's word."""
        self._sightings[sighting.source] = sighting

    def nearest_m(self, now_s: float) -> float:
        """Return the distance to the nearest obstacle ahead; infinite when there is none or nobody watches."""
        return min((sighting.distance_m for sighting in self._fresh(now_s)), default=math.inf)

    def forget_hold(self) -> None:
        """Start anew with another reference: its way is another one."""
        self._last_in_way_s = None

    def blocked(self, way: Way, now_s: float) -> bool:
        """Return whether to hold: something is in the way, or it was until less than half a second ago."""
        if any(self._in_way(sighting, way) for sighting in self._fresh(now_s)):
            self._last_in_way_s = now_s
        elif self._last_in_way_s is not None and now_s - self._last_in_way_s >= self._settings.obstacle_clear_s:
            self._last_in_way_s = None
        return self._last_in_way_s is not None

    def _fresh(self, now_s: float) -> list[Sighting]:
        age_s = self._settings.obstacle_age_s
        return [s for s in self._sightings.values() if s.detected and abs(now_s - s.stamp_s) < age_s and not math.isnan(s.distance_m)]

    def _in_way(self, sighting: Sighting, way: Way) -> bool:
        settings = self._settings
        to_go_m = way.remaining_enu_m.horizontal
        if to_go_m < LEAST_TRAVEL_M or sighting.distance_m > to_go_m + settings.obstacle_clearance_m:
            return False
        needed_m = braking_distance(way.speed_m_s, settings.max_accel_m_s2) + settings.obstacle_clearance_m
        return sighting.distance_m < max(settings.obstacle_stop_m, needed_m) and not _aside(sighting, way)


def _aside(sighting: Sighting, way: Way) -> bool:
    """Return whether the nearest point is certainly not ahead, as after a change of direction."""
    offset = sighting.nearest_enu_m - way.position_enu_m
    if offset.horizontal < BELIEVE_PLACE_M or abs(offset.horizontal - sighting.distance_m) > BELIEVE_PLACE_M:
        return False
    ahead = offset.x * way.remaining_enu_m.x + offset.y * way.remaining_enu_m.y
    return ahead < ASIDE_COSINE * offset.horizontal * way.remaining_enu_m.horizontal
