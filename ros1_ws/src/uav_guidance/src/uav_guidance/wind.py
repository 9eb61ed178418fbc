"""How strongly the wind blows, by how far the vehicle leans to hold its way: a warning before it is blown off it."""

from __future__ import annotations

import math

from uav_guidance.vehicle import VehicleSnapshot

MEAN_S = 3.0  # time constant: longer than it leans to set off or to brake
STRONG_RAD = math.radians(20.0)  # two thirds of what ArduCopter leans at most (ANGLE_MAX, 30 degrees)
CALM_RAD = math.radians(15.0)  # below which it may be told of again


class WindWatch:
    """Average by how far the vehicle leans, and to which side. Times are seconds of the mission clock."""

    def __init__(self) -> None:
        self._east = self._north = 0.0
        self._stepped_s: float | None = None
        self._strong = False

    def step(self, vehicle: VehicleSnapshot, now_s: float) -> str:
        """Update with the present attitude; return a warning of a wind that has become strong, empty if there is none."""
        passed_s = 0.0 if self._stepped_s is None else max(now_s - self._stepped_s, 0.0)
        self._stepped_s = now_s
        if vehicle.quat_xyzw is None or not vehicle.off_ground:
            self._east = self._north = 0.0
            self._strong = False
            return ""
        x, y, z, w = vehicle.quat_xyzw
        part = 1.0 - math.exp(-passed_s / MEAN_S)
        self._east += part * (2.0 * (x * z + w * y) - self._east)  # of the body's upward axis
        self._north += part * (2.0 * (y * z - w * x) - self._north)
        lean_rad = math.asin(min(math.hypot(self._east, self._north), 1.0))
        was_strong, self._strong = self._strong, lean_rad >= (CALM_RAD if self._strong else STRONG_RAD)
        if was_strong or not self._strong:
            return ""
        return f"the wind is strong: the vehicle leans by {math.degrees(lean_rad):.0f} degrees to hold its way"
