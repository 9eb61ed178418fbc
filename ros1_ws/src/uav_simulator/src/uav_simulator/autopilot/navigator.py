"""Turn a goal (where to, how fast, which way to look) into the moving reference that the controller follows."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_simulator.autopilot.estimator import Estimate
from uav_simulator.autopilot.params import Parameters
from uav_simulator.frames import Vec3, wrap_pi
from uav_simulator.vehicle.controller import Reference
from uav_simulator.vehicle.shaping import Limits, Shaper

YAW_ACCEL_RAD_S2 = 1.2
YAW_JERK_RAD_S3 = 8.0
TRAVEL_MIN_M_S = 0.25  # below, the direction of travel says nothing
STOP_TIME_S = 0.7  # a vehicle at v stops about 0.7 s * v further


@dataclass
class Goal:
    """Per group of axes a place to go to (None: none) and a velocity: of the place, or to fly when there is no place."""

    xy: tuple[float, float] | None
    z: float | None
    velocity: Vec3 = (0.0, 0.0, 0.0)
    expires_s: float = math.inf  # when the velocity does; then the vehicle stops


class Navigator:
    """Keeps goal and yaw, and moves the reference once every 20 ms."""

    def __init__(self, params: Parameters) -> None:
        self._params = params
        self._xy, self._z, self._yaw = Shaper((0.0, 0.0)), Shaper((0.0,)), Shaper((0.0,))
        self.goal = Goal((0.0, 0.0), 0.0)
        self.yaw_target: float | None = None  # unwrapped, rad; None: along the travel
        self.yaw_rate: float | None = None  # rad/s; overrides the target
        self.yaw_stick_rad_s = 0.0  # the pilot's; overrides both while it is not centred
        self.yaw_speed_rad_s = 0.0
        self.speeds_m_s = {"horizontal": 0.0, "up": 0.0, "down": 0.0}
        self.reset_speeds()

    def reset_speeds(self) -> None:
        """Take the speed limits from the parameters again."""
        p = self._params
        self.speeds_m_s = {"horizontal": p["WPNAV_SPEED"] / 100, "up": p["WPNAV_SPEED_UP"] / 100, "down": p["WPNAV_SPEED_DN"] / 100}
        self.yaw_speed_rad_s = math.radians(p["ATC_SLEW_YAW"] / 100.0)

    def restart(self, estimate: Estimate) -> None:
        """Begin at the present place and heading, with the present velocity, to hold there."""
        p, v = estimate.position, estimate.velocity
        self._xy.restart((p[0], p[1]), (v[0], v[1]))
        self._z.restart((p[2],), (v[2],))
        self._yaw.restart((estimate.yaw_rad,), (0.0,))
        self.hold_yaw()
        self.stop()

    def stop(self) -> None:
        """Stop and hold where that ends."""
        x, y = (p + STOP_TIME_S * v for p, v in zip(self._xy.position, self._xy.velocity, strict=True))
        self.goal = Goal((x, y), self._z.position[0] + 0.4 * self._z.velocity[0])

    def hold_yaw(self) -> None:
        """Take the reference's present heading as the target."""
        self.yaw_target, self.yaw_rate = self._yaw.position[0], None

    def look(self, yaw_rad: float, *, turn: int = 0) -> None:
        """Turn to a heading: the shorter way (0), counter-clockwise (1) or clockwise (-1)."""
        change = wrap_pi(yaw_rad - self._yaw.position[0])
        if turn * change < 0.0:
            change += turn * 2.0 * math.pi
        self.yaw_target, self.yaw_rate = self._yaw.position[0] + change, None

    def look_along_travel(self) -> None:
        """Turn the nose into the direction of travel, from now on."""
        if self._params["WP_YAW_BEHAVIOR"] == 0.0:
            self.hold_yaw()
        else:
            self.yaw_target = self.yaw_rate = None

    @property
    def yaw_rad(self) -> float:
        """Return the reference's heading in [-pi, pi), radians."""
        return wrap_pi(self._yaw.position[0])

    def keep_above(self, floor_m: float) -> None:
        """Do not let the reference run away below the ground on which the vehicle stands."""
        if self._z.position[0] < floor_m:
            self._z.restart((floor_m,), self._z.velocity)

    def step(self, now_s: float, dt_s: float) -> Reference:
        """Advance the reference by one period."""
        goal, p = self.goal, self._params
        if now_s > goal.expires_s:
            goal.velocity, goal.expires_s = (0.0, 0.0, 0.0), math.inf
            self.yaw_rate = None if self.yaw_rate is None else 0.0
        vx, vy, vz = goal.velocity
        horizontal = Limits(self.speeds_m_s["horizontal"], p["WPNAV_ACCEL"] / 100, p["PSC_JERK_XY"], 1.0)
        if goal.xy is None:
            self._xy.at_velocity((vx, vy), horizontal, dt_s)
        else:
            goal.xy = (goal.xy[0] + vx * dt_s, goal.xy[1] + vy * dt_s)
            self._xy.toward(goal.xy, (vx, vy), horizontal, dt_s)
        self._step_z(goal, vz, dt_s)
        self._step_yaw(dt_s)
        return Reference(
            position=(self._xy.position[0], self._xy.position[1], self._z.position[0]),
            velocity=(self._xy.velocity[0], self._xy.velocity[1], self._z.velocity[0]),
            accel=(self._xy.accel[0], self._xy.accel[1], self._z.accel[0]),
            yaw_rad=self._yaw.position[0],
            yaw_rate_rad_s=self._yaw.velocity[0],
        )

    def _step_z(self, goal: Goal, velocity: float, dt_s: float) -> None:
        """Advance the vertical axis; up and down have limits of their own."""
        p = self._params
        rising = velocity > 0.0 if goal.z is None else goal.z > self._z.position[0]
        limits = Limits(self.speeds_m_s["up" if rising else "down"], p["WPNAV_ACCEL_Z"] / 100, p["PSC_JERK_Z"], 2.0)
        if goal.z is None:
            self._z.at_velocity((velocity,), limits, dt_s)
        else:
            goal.z += velocity * dt_s
            self._z.toward((goal.z,), (velocity,), limits, dt_s)

    def _step_yaw(self, dt_s: float) -> None:
        limits = Limits(self.yaw_speed_rad_s, YAW_ACCEL_RAD_S2, YAW_JERK_RAD_S3, 2.0)
        rate = self.yaw_stick_rad_s or self.yaw_rate
        if rate is not None:
            self._yaw.at_velocity((rate,), limits, dt_s)
            return
        target = self.yaw_target
        if target is None:
            vx, vy = self._xy.velocity
            moving = math.hypot(vx, vy) > TRAVEL_MIN_M_S
            now = self._yaw.position[0]
            target = now + wrap_pi(math.atan2(vy, vx) - now) if moving else now
        self._yaw.toward((target,), (0.0,), limits, dt_s)
