"""Three numbers with a direction."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Vec3:
    """A vector; its frame and unit are in the name of the variable that holds it."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __add__(self, other: Vec3) -> Vec3:
        return Vec3(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vec3) -> Vec3:
        return Vec3(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, factor: float) -> Vec3:
        return Vec3(self.x * factor, self.y * factor, self.z * factor)

    def turned(self, yaw_rad: float) -> Vec3:
        """Return the vector turned about the vertical, counter-clockwise."""
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        return Vec3(c * self.x - s * self.y, s * self.x + c * self.y, self.z)

    def dot(self, other: Vec3) -> float:
        """Return the scalar product of the two vectors."""
        return self.x * other.x + self.y * other.y + self.z * other.z

    @property
    def norm(self) -> float:
        """The Euclidean length, in the vector's unit."""
        return math.hypot(self.x, self.y, self.z)

    @property
    def horizontal(self) -> float:
        """The length of the part in the x-y plane."""
        return math.hypot(self.x, self.y)

    @property
    def finite(self) -> bool:
        """Whether no part is NaN or infinite."""
        return math.isfinite(self.x) and math.isfinite(self.y) and math.isfinite(self.z)


ZERO = Vec3()


@dataclass(frozen=True, slots=True)
class Line:
    """The straight way from a start to a target, both in the same frame, metres."""

    start: Vec3
    target: Vec3

    @property
    def length(self) -> float:
        """Metres from start to target."""
        return (self.target - self.start).norm

    @property
    def direction(self) -> Vec3:
        """Unit vector from start to target; zero if they are the same."""
        length = self.length
        return (self.target - self.start) * (1.0 / length) if length > 1e-9 else Vec3()

    def at(self, travelled: float) -> Vec3:
        """Return the point that lies so many metres from the start."""
        return self.start + self.direction * travelled

    def along(self, point: Vec3) -> float:
        """Return how far along the line a point is: metres from the start of its foot point, which may lie outside."""
        return (point - self.start).dot(self.direction)

    def distance(self, point: Vec3) -> float:
        """Return the distance of a point from the line between start and target."""
        return (point - self.at(min(max(self.along(point), 0.0), self.length))).norm
