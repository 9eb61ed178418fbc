"""What the autopilot believes about its state: the truth with a small, slowly varying error, once enough time has passed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_simulator.frames import Quat, Vec3, wrap_pi
from uav_simulator.vehicle.noise import SlowNoise
from uav_simulator.vehicle.quaternion import euler_zyx, from_yaw, multiply
from uav_simulator.vehicle.rigid_body import RigidBody

READY_AFTER_S = 40.0  # of power: tilt alignment, GPS fix, origin


@dataclass(frozen=True)
class Estimate:
    """Position relative to the origin and velocity (ENU), attitude (FLU to ENU), body rates (FLU)."""

    position: Vec3
    velocity: Vec3
    attitude: Quat
    rates: Vec3
    yaw_error_rad: float

    @property
    def euler(self) -> Vec3:
        """Return roll, pitch, yaw (z-y-x, FLU and ENU)."""
        return euler_zyx(self.attitude)

    @property
    def yaw_rad(self) -> float:
        """Return the estimated yaw, counter-clockwise from east."""
        return wrap_pi(self.euler[2])


class Estimator:
    """Adds the errors; each axis stays within 1.7 cm, so the position within 3 cm."""

    def __init__(self, seed: int) -> None:
        self._position = SlowNoise(sigma=0.007, tau_s=20.0, limit=0.017, seed=f"ekf position {seed}")
        self._velocity = SlowNoise(sigma=0.01, tau_s=2.0, limit=0.03, seed=f"ekf velocity {seed}")
        self._yaw = SlowNoise(sigma=math.radians(0.3), tau_s=30.0, limit=math.radians(1.0), seed=f"ekf yaw {seed}")

    def step(self, body: RigidBody, dt_s: float) -> Estimate:
        """Return the estimate of a body's state."""
        dp, dv, yaw = self._position.step(dt_s), self._velocity.step(dt_s), self._yaw.step(dt_s)[0]
        if body.on_ground:
            dv = (0.0, 0.0, 0.0)  # zero-velocity updates hold the filter while the vehicle stands
        p, v = body.position, body.velocity
        return Estimate(
            position=(p[0] + dp[0], p[1] + dp[1], p[2] + dp[2]),
            velocity=(v[0] + dv[0], v[1] + dv[1], v[2] + dv[2]),
            attitude=multiply(from_yaw(yaw), body.attitude),
            rates=body.rates,
            yaw_error_rad=yaw,
        )
