"""Detects a touch-down as ArduCopter's land detector does [8]."""

from __future__ import annotations

from uav_simulator.vehicle.controller import AttitudeTarget
from uav_simulator.vehicle.rigid_body import RigidBody

TOUCH_DOWN_S = 1.0  # of standing before the landing is believed
PRESSED = 0.9  # of the hover thrust: less thrust than this, and still no movement, means that the ground carries


class TouchDown:
    """Counts for how long the vehicle has stood at low thrust."""

    def __init__(self, hover_thrust_n: float) -> None:
        self._limit_n = PRESSED * hover_thrust_n
        self.standing_s = 0.0

    def step(self, body: RigidBody, target: AttitudeTarget | None, dt_s: float) -> bool:
        """Return whether the vehicle has landed by now; call every period in the air except during a take-off."""
        pressed = target is None or target.thrust_n < self._limit_n
        self.standing_s = self.standing_s + dt_s if body.on_ground and pressed else 0.0
        return self.standing_s >= TOUCH_DOWN_S
