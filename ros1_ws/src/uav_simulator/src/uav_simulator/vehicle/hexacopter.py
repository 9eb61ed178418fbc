"""The vehicle as the autopilot drives it: a body, its wind and its inner loops, advanced 20 ms at a time."""

from __future__ import annotations

from uav_simulator.frames import Vec3
from uav_simulator.vehicle.airframe import Airframe
from uav_simulator.vehicle.controller import OFF, AttitudeLoop, AttitudeTarget, Gains
from uav_simulator.vehicle.noise import Wind
from uav_simulator.vehicle.rigid_body import ZERO, RigidBody

STEP_S = 0.0025  # 400 Hz


class Hexacopter:
    """Body, wind and attitude control; ``target`` None means that the motors are off."""

    def __init__(self, airframe: Airframe, wind: Wind | None, position: Vec3 = ZERO, yaw_rad: float = 0.0) -> None:
        self.body = RigidBody(airframe, position, yaw_rad)
        self._attitude_loop = AttitudeLoop(airframe, Gains())
        self._wind = wind
        self.target: AttitudeTarget | None = None

    def advance(self, duration_s: float) -> None:
        """Integrate over a duration in steps of 2.5 ms; the wind changes once per call."""
        wind = self._wind.step(duration_s) if self._wind else ZERO
        body, target = self.body, self.target
        if target is None and body.on_ground and not any(body.thrusts):
            return  # nothing moves, nothing to integrate
        for _ in range(round(duration_s / STEP_S)):
            commands = OFF if target is None else self._attitude_loop.step(target, body)
            body.step(STEP_S, commands, wind)
        if target is None and max(body.thrusts) < 1e-3:
            body.thrusts = OFF
