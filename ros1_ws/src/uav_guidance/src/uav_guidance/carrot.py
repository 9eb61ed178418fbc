"""The carrot that the vehicle follows: a point on a line, and a heading, that move with limited speed and acceleration."""

from __future__ import annotations

import math

from uav_guidance.frames import wrap
from uav_guidance.vectors import Line, Vec3


def braking_distance(speed_m_s: float, accel_m_s2: float) -> float:
    """Return the metres, v^2 / 2a, that it takes to stop from a speed."""
    return speed_m_s * speed_m_s / (2.0 * accel_m_s2)


def stop_point(position_m: Vec3, velocity_m_s: Vec3, accel_m_s2: float) -> Vec3:
    """Return where a vehicle in motion comes to rest when it brakes evenly."""
    return position_m + velocity_m_s * (velocity_m_s.norm / (2.0 * accel_m_s2))


class LineCarrot:
    """Run along a line with a trapezoid speed profile, never far ahead of the vehicle that follows, never backwards."""

    def __init__(self, line: Line, *, speed_m_s: float, accel_m_s2: float, lead_m: float, initial_speed_m_s: float = 0.0) -> None:
        self.line = line
        self.travelled_m = 0.0
        self.speed_m_s = min(max(initial_speed_m_s, 0.0), speed_m_s, math.sqrt(2.0 * accel_m_s2 * line.length))
        self._cruise_m_s = speed_m_s
        self._accel_m_s2 = accel_m_s2
        self._lead_m = lead_m

    @property
    def point(self) -> Vec3:
        """The carrot's position on the line (frame of the line, metres)."""
        return self.line.at(self.travelled_m)

    def step(self, follower_m: Vec3, dt_s: float) -> Vec3:
        """Move on by one time step and return the carrot's place.

        It plans to stand still at the end of the line, or at its lead before the follower, whichever is nearer.
        """
        end_m = min(self.line.length, self.line.along(follower_m) + self._lead_m)
        change = self._accel_m_s2 * dt_s
        wanted = min(self.speed_m_s + change, self._cruise_m_s, self._stoppable(end_m - self.travelled_m, dt_s))
        self.speed_m_s = max(wanted, self.speed_m_s - change, 0.0)
        self.travelled_m += self.speed_m_s * dt_s
        if self.travelled_m >= self.line.length:
            self.travelled_m, self.speed_m_s = self.line.length, 0.0
        return self.point

    def rest_at(self, travelled_m: float) -> None:
        """Stand at this place of the line, to start from there again."""
        self.travelled_m = min(max(travelled_m, 0.0), self.line.length)
        self.speed_m_s = 0.0

    def _stoppable(self, room_m: float, dt_s: float) -> float:
        """Return the speed v at which one more step and braking after it fit: v dt + v^2 / 2a = room."""
        if room_m <= 0.0:
            return 0.0
        lag = self._accel_m_s2 * dt_s
        return math.sqrt(lag * lag + 2.0 * self._accel_m_s2 * room_m) - lag


class HeadingCarrot:
    """Turn towards a heading at a limited rate, the short way round, never far ahead of the vehicle's own nose."""

    LEAD_RAD = math.radians(40.0)

    def __init__(self, yaw_rad: float) -> None:
        self.yaw_rad = yaw_rad
        self.target_rad = yaw_rad
        self._rate_rad_s = 0.0

    def turn(self, target_rad: float, rate_rad_s: float) -> None:
        """Turn to a heading from where the carrot is now."""
        self.target_rad = wrap(target_rad)
        self._rate_rad_s = rate_rad_s

    def hold(self, yaw_rad: float) -> None:
        """Stop turning and keep this heading."""
        self.yaw_rad = self.target_rad = wrap(yaw_rad)

    def step(self, follower_rad: float, dt_s: float) -> float:
        """Move on by one time step and return the carrot's heading."""
        to_go = wrap(self.target_rad - self.yaw_rad)
        ahead = wrap(self.yaw_rad - follower_rad) * math.copysign(1.0, to_go)
        turn = min(abs(to_go), self._rate_rad_s * dt_s, max(0.0, self.LEAD_RAD - ahead))
        self.yaw_rad = wrap(self.yaw_rad + math.copysign(turn, to_go))
        return self.yaw_rad
