"""Shape where the vehicle should be: a reference that moves to its target within limits of speed, acceleration and jerk.

The way ArduCopter's position controller shapes its inputs: a square-root law gives the speed at which the rest of the way can
still be braked, and the acceleration follows with limited jerk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Limits in m/s, m/s2, m/s3 (or rad); ``gain_s`` is the speed per distance close to the target, 1/s."""

    speed: float
    accel: float
    jerk: float
    gain_s: float = 1.5


def braking_speed(distance: float, limits: Limits) -> float:
    """Return the speed at which the distance can be braked: linear close by, then along a square root, at most the limit."""
    accel = 0.6 * limits.accel  # leaves room for the jerk-limited beginning of the braking
    linear = accel / (limits.gain_s * limits.gain_s)
    speed = limits.gain_s * distance if distance < linear else math.sqrt(2.0 * accel * (distance - linear / 2.0))
    return min(speed, limits.speed)


class Shaper:
    """A point in ``n`` axes that share their limits (2: horizontal, 1: vertical or yaw)."""

    def __init__(self, position: tuple[float, ...]) -> None:
        self.position = position
        self.velocity = (0.0,) * len(position)
        self.accel = (0.0,) * len(position)

    def restart(self, position: tuple[float, ...], velocity: tuple[float, ...]) -> None:
        """Begin again from where the vehicle is."""
        self.position, self.velocity, self.accel = position, velocity, (0.0,) * len(position)

    def toward(self, target: tuple[float, ...], target_velocity: tuple[float, ...], limits: Limits, dt_s: float) -> None:
        """Advance toward a target that itself moves with a velocity."""
        rest = tuple(t - p for t, p in zip(target, self.position, strict=True))
        distance = math.sqrt(sum(r * r for r in rest))
        speed = braking_speed(distance, limits)
        scale = speed / distance if distance > 1e-6 else 0.0
        self.at_velocity(tuple(r * scale + v for r, v in zip(rest, target_velocity, strict=True)), limits, dt_s)

    def at_velocity(self, wanted: tuple[float, ...], limits: Limits, dt_s: float) -> None:
        """Advance, coming to a wanted velocity."""
        wanted = _clipped(wanted, limits.speed)
        response = max(2.0, limits.jerk / limits.accel) * 1.5
        goal = _clipped(tuple((w - v) * response for w, v in zip(wanted, self.velocity, strict=True)), limits.accel)
        change = _clipped(tuple(g - a for g, a in zip(goal, self.accel, strict=True)), limits.jerk * dt_s)
        self.accel = tuple(a + c for a, c in zip(self.accel, change, strict=True))
        before = self.velocity
        self.velocity = tuple(v + a * dt_s for v, a in zip(before, self.accel, strict=True))
        self.position = tuple(p + 0.5 * (u + v) * dt_s for p, u, v in zip(self.position, before, self.velocity, strict=True))


def _clipped(vector: tuple[float, ...], limit: float) -> tuple[float, ...]:
    """Return the vector, shortened to a length."""
    length = math.sqrt(sum(v * v for v in vector))
    if length <= limit:
        return vector
    return tuple(v * limit / length for v in vector)
