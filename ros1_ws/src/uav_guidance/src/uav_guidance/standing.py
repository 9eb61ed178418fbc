"""A landing that does not end: the vehicle stands on the ground, and the autopilot takes it for flying, its motors on.

ArduCopter does so after a hard landing, as with a motor that has stopped: its detector waits for motors that need not work any more. In
LAND a vehicle in the air always sinks, at 0.5 m/s, so one that does not move for seconds is carried by something.
"""

from __future__ import annotations

from uav_guidance.vectors import Vec3
from uav_guidance.vehicle import Mode, VehicleSnapshot

STANDS_S = 5.0  # a landing sinks by 2.5 m meanwhile
MOVED_M = 0.1  # since it began to stand
SPEED_M_S = 0.1
RATE_RAD_S = 0.05
LOW_M = 1.2  # above home: a landing that is broken off here dips by 0.15 m, and its propellers are 0.85 m from the middle
GROUND_M = 0.5  # above home: higher, it may lie in a tree or on a roof, and fall when its motors stop


class Standing:
    """For how long the vehicle has stood still in a landing. Times are seconds of the mission clock."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._place = Vec3()

    def restart(self) -> None:
        """Begin to count anew."""
        self._since_s = None

    def step(self, vehicle: VehicleSnapshot, now_s: float, *, landing: bool) -> bool:
        """Return whether it has stood still, armed, for long; ``landing``: it is in a landing that the companion asked for."""
        place = vehicle.position_enu_m
        slow = vehicle.velocity_enu_m_s.norm < SPEED_M_S and vehicle.rates_flu_rad_s.norm < RATE_RAD_S
        if not (landing and vehicle.mode == Mode.LAND and vehicle.armed and vehicle.located and slow) or place is None:
            self._since_s = None
        elif self._since_s is None or now_s < self._since_s or (place - self._place).norm > MOVED_M:
            self._since_s, self._place = now_s, place
        return self._since_s is not None and now_s - self._since_s >= STANDS_S


def above_home_m(vehicle: VehicleSnapshot) -> float:
    """Return the height above home; infinite where home or place are not known."""
    if vehicle.position_enu_m is None or vehicle.home_enu_m is None:
        return float("inf")
    return vehicle.position_enu_m.z - vehicle.home_enu_m.z
