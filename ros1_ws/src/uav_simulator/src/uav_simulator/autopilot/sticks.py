"""A pilot's sticks, the remote control's or those of MANUAL_CONTROL by a ground station: their deflection, and the motion it requests."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_simulator.autopilot.params import Parameters
from uav_simulator.frames import Vec3

ROLL_PITCH_DEAD, THROTTLE_DEAD, YAW_DEAD = 0.04, 0.2, 0.04
"""Parts of the way around the middle that count as centred: RCn_DZ and THR_DZ of ArduCopter."""


@dataclass(frozen=True)
class Deflection:
    """How far the sticks are from the middle, -1 to 1: to the front, to the left, up, and counter-clockwise."""

    forward: float = 0.0
    left: float = 0.0
    up: float = 0.0
    turn: float = 0.0

    @property
    def moves(self) -> bool:
        """Return whether it takes the vehicle anywhere."""
        return bool(self.forward or self.left or self.up)


CENTRED = Deflection()


class Sticks:
    """Remembers what came last; it counts for RC_OVERRIDE_TIME, then the remote control's own sticks do: centred, but for the throttle."""

    def __init__(self, params: Parameters) -> None:
        self._params = params
        self._moved_s = -math.inf
        self._last = CENTRED
        self._own = CENTRED

    def set_throttle(self, up: float) -> None:
        """Leave the remote control's throttle at -1 (zero) to 1; without a remote control, ArduPilot's simulator has it at zero."""
        self._own = Deflection(up=_live(up, THROTTLE_DEAD))

    def move(self, raw: Deflection, now_s: float) -> None:
        """Apply a MANUAL_CONTROL."""
        self._moved_s = now_s
        self._last = Deflection(
            _live(raw.forward, ROLL_PITCH_DEAD), _live(raw.left, ROLL_PITCH_DEAD), _live(raw.up, THROTTLE_DEAD), _live(raw.turn, YAW_DEAD)
        )

    def at(self, now_s: float) -> Deflection:
        """Return the present deflection; a ground station's counts only for RC_OVERRIDE_TIME."""
        return self._last if now_s - self._moved_s <= self._params["RC_OVERRIDE_TIME"] else self._own

    def velocity_m_s(self, stick: Deflection, yaw_rad: float) -> Vec3:
        """Return the velocity (m/s, ENU) that a deflection requests."""
        p = self._params
        scale = p["LOIT_SPEED"] / 100.0 / max(1.0, math.hypot(stick.forward, stick.left))
        east = math.cos(yaw_rad) * stick.forward - math.sin(yaw_rad) * stick.left
        north = math.sin(yaw_rad) * stick.forward + math.cos(yaw_rad) * stick.left
        return scale * east, scale * north, p["PILOT_SPEED_UP"] / 100.0 * stick.up

    def turn_rad_s(self, stick: Deflection) -> float:
        """Return the rate of turn (rad/s) that a deflection requests, counter-clockwise."""
        return math.radians(self._params["PILOT_Y_RATE"]) * stick.turn


def _live(part: float, dead: float) -> float:
    """Return the part of the way beyond the dead zone, -1 to 1."""
    return math.copysign(min(max(abs(part) - dead, 0.0) / (1.0 - dead), 1.0), part) if abs(part) > dead else 0.0
