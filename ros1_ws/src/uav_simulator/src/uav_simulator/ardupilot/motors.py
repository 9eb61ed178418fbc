"""From ArduPilot's outputs to rotor thrusts: its HEXA X numbering, and the curve that its parameters undo.

The parameters that belong to this body are in ``hexacopter.parm`` beside the worlds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from uav_simulator.vehicle.airframe import ROTORS, Airframe

# Motors 1 to 6: degrees clockwise from forward, and the sense of rotation seen from above.
HEXA_X = ((90.0, "cw"), (-90.0, "ccw"), (-30.0, "cw"), (150.0, "ccw"), (30.0, "ccw"), (-150.0, "cw"))
PWM_LOW_US, PWM_HIGH_US = 1000.0, 2000.0  # MOT_PWM_MIN, MOT_PWM_MAX
SPIN_MIN, SPIN_MAX = 0.15, 0.95  # MOT_SPIN_MIN, MOT_SPIN_MAX: the part of the range that is thrust
THRUST_EXPO = 0.65  # MOT_THST_EXPO: how much of the thrust goes with the square of the output


@dataclass(frozen=True)
class HexaX(Airframe):
    """The airframe with its rotors in the order and the senses of ArduPilot's HEXA X."""

    @property
    def rotor_places(self) -> tuple[tuple[float, float, float], ...]:
        """Return per motor x forward, y left in metres, and the sign of its yaw torque: a clockwise rotor turns the body the other way."""
        places = []
        for angle_deg, sense in HEXA_X:
            angle = math.radians(-angle_deg)
            places.append((self.arm_m * math.cos(angle), self.arm_m * math.sin(angle), 1.0 if sense == "cw" else -1.0))
        return tuple(places)


def thrusts_n(pwm_us: Sequence[int], rotor_max_n: float) -> tuple[float, ...]:
    """Return the thrust commands of the motors 1 to 6 in newtons; below the idle output there is none."""
    return tuple(rotor_max_n * _part(pwm) for pwm in pwm_us[:ROTORS])


def _part(pwm_us: int) -> float:
    """Return the part of the greatest thrust, 0..1."""
    output = (pwm_us - PWM_LOW_US) / (PWM_HIGH_US - PWM_LOW_US)
    part = min(max((output - SPIN_MIN) / (SPIN_MAX - SPIN_MIN), 0.0), 1.0)
    return (1.0 - THRUST_EXPO) * part + THRUST_EXPO * part * part
