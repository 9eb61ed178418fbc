"""Whether the way ahead is free: the last verdict of each sensor, when to hold and when to go on.

A vehicle moves on when a sensor has just said that the way is free. What no sensor could judge is not free, and neither is what no
sensor looks at any more. Where no sensor has watched since the vehicle stood on the ground, it flies unwatched: that is the operator's
choice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from uav_guidance.carrot import braking_distance
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import ZERO, Vec3

LEAST_TRAVEL_M = 0.3  # the corridor is horizontal: a climb on the spot has no way ahead
ASIDE_COSINE = 0.5  # farther than 60 degrees from the travel is not ahead
BELIEVE_PLACE_M = 1.0  # the nearest point must fit the distance to be believed


@dataclass(frozen=True)
class Sighting:
    """One sensor's verdict on the corridor ahead; the distance is along it, from the vehicle's centre, metres."""

    source: str
    stamp_s: float
    detected: bool
    distance_m: float
    nearest_enu_m: Vec3 = ZERO
    unknown: bool = False
    """The sensor could not judge the corridor."""


@dataclass(frozen=True)
class _Heard:
    sighting: Sighting
    arrival_s: float


@dataclass(frozen=True)
class Way:
    """What lies before the vehicle: the place, the way to the target, the speed towards it."""

    position_enu_m: Vec3
    remaining_enu_m: Vec3
    speed_m_s: float


class ObstacleWatch:
    """Remember the last verdict of each sensor and decide when to hold and when to go on."""

    def __init__(self, settings: GuidanceSettings) -> None:
        self.settings = settings
        self._heard: dict[str, _Heard] = {}
        self._last_in_way_s: float | None = None

    def see(self, sighting: Sighting, now_s: float) -> None:
        """Handle a sensor's verdict; ignore one that is no newer than the last one, or of the future.

        Something that is seen at no distance may be anywhere: the way can't be judged by that.
        """
        last = self._heard.get(sighting.source)
        if sighting.detected and not math.isfinite(sighting.distance_m):
            sighting = replace(sighting, detected=False, unknown=True, distance_m=math.inf)
        if not sighting.stamp_s <= now_s + self.settings.watch_age_s:
            sighting = replace(sighting, stamp_s=-math.inf)
        if last is None or sighting.stamp_s > last.sighting.stamp_s or now_s < last.arrival_s:
            self._heard[sighting.source] = _Heard(sighting, now_s)

    def forget_sensors(self) -> None:
        """Forget all sensors, on the ground: the way counts as watched once a sensor reports it."""
        self._heard.clear()

    def forget_hold(self) -> None:
        """Forget the last obstacle in the way: another reference has another way."""
        self._last_in_way_s = None

    def nearest_m(self, now_s: float) -> float:
        """Return the distance to the nearest obstacle ahead; infinite when there is none or no sensor watches."""
        return min((s.distance_m for s in self._fresh(now_s) if s.detected), default=math.inf)

    def unwatched(self, now_s: float) -> bool:
        """Return whether a sensor has watched in this flight, and none that watches now can judge the way."""
        return bool(self._heard) and all(sighting.unknown for sighting in self._fresh(now_s))

    def blocked(self, way: Way, now_s: float) -> bool:
        """Return whether to hold: something is in the way, or was until less than half a second ago, or no sensor watches."""
        if any(sighting.detected and self._in_way(sighting, way) for sighting in self._fresh(now_s)):
            self._last_in_way_s = now_s
        elif self._last_in_way_s is not None and now_s - self._last_in_way_s >= self.settings.obstacle_clear_s:
            self._last_in_way_s = None
        travels = way.remaining_enu_m.horizontal >= LEAST_TRAVEL_M  # the sensors watch a horizontal corridor, not a climb on the spot
        return self._last_in_way_s is not None or (travels and self.unwatched(now_s))

    def _fresh(self, now_s: float) -> list[Sighting]:
        """Return the verdicts that still hold: just arrived, and on a measurement that is not old."""
        settings = self.settings
        return [
            heard.sighting
            for heard in self._heard.values()
            if abs(now_s - heard.arrival_s) <= settings.watch_age_s and now_s - heard.sighting.stamp_s <= settings.obstacle_age_s
        ]

    def _in_way(self, sighting: Sighting, way: Way) -> bool:
        settings = self.settings
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
