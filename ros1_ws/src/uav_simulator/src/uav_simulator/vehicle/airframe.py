"""The constants of the vehicle: a 14 kg hexacopter of the DJI M600's size (paper, section 6)."""

from __future__ import annotations

import math
from dataclasses import dataclass

GRAVITY_M_S2 = 9.80665
ROTORS = 6


@dataclass(frozen=True)
class Airframe:
    """Mass properties, rotors and drag."""

    mass_kg: float = 14.0
    inertia_kg_m2: tuple[float, float, float] = (0.85, 0.85, 1.5)
    arm_m: float = 0.566
    radius_m: float = 0.85  # with propellers
    rotor_max_n: float = 45.0
    rotor_lag_s: float = 0.05
    rotor_torque_m: float = 0.04  # yaw torque per thrust
    drag_linear_kg_s: float = 1.2
    drag_square_kg_m: float = 0.35
    spin_drag_n_m_s: float = 0.12

    @property
    def hover_thrust_n(self) -> float:
        """Return the thrust of all rotors that carries the weight."""
        return self.mass_kg * GRAVITY_M_S2

    @property
    def rotor_places(self) -> tuple[tuple[float, float, float], ...]:
        """Return per rotor x forward, y left in metres, and the sign of its yaw torque."""
        angles = [math.radians(30.0 + 60.0 * i) for i in range(ROTORS)]
        return tuple((self.arm_m * math.cos(a), self.arm_m * math.sin(a), 1.0 if i % 2 else -1.0) for i, a in enumerate(angles))
