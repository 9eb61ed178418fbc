"""Volumes of a world in which the radio between vehicle and ground is worse than outside. Frame map: ENU, metres."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from uav_simulator.frames import Vec3


class RadioQuality(Enum):
    """How good the radio is, the best first."""

    GOOD = "good"
    DEGRADED = "degraded"
    CRITICAL = "critical"


class Volume(Protocol):
    """A closed part of space (ENU, metres)."""

    def contains(self, point: Vec3) -> bool:
        """Return whether a point lies in it, its surface included."""


@dataclass(frozen=True)
class BoxVolume:
    """A box between two corners, along the axes (ENU, metres)."""

    low: Vec3
    high: Vec3

    def contains(self, point: Vec3) -> bool:
        """Return whether a point lies in it."""
        return all(low <= v <= high for low, v, high in zip(self.low, point, self.high, strict=True))


@dataclass(frozen=True)
class CylinderVolume:
    """An upright cylinder about ``at`` between two heights."""

    at: tuple[float, float]
    radius_m: float
    z: tuple[float, float]

    def contains(self, point: Vec3) -> bool:
        """Return whether a point lies in it."""
        return math.dist(point[:2], self.at) <= self.radius_m and self.z[0] <= point[2] <= self.z[1]


@dataclass(frozen=True)
class SphereVolume:
    """A ball around ``at`` (ENU, metres)."""

    at: Vec3
    radius_m: float

    def contains(self, point: Vec3) -> bool:
        """Return whether a point lies in it."""
        return math.dist(point, self.at) <= self.radius_m


@dataclass(frozen=True)
class RadioZone:
    """A volume with the radio's quality in it."""

    name: str
    quality: RadioQuality
    volume: Volume


def radio_zone_at(zones: Iterable[RadioZone], point: Vec3) -> RadioZone | None:
    """Return the zone at a point: the first one listed that contains it; None outside of all, where the radio is good."""
    return next((zone for zone in zones if zone.volume.contains(point)), None)
