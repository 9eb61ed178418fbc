"""What the autopilot believes about its state: the truth with a small, slowly varying error, once enough time has passed."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from uav_simulator.autopilot.satellites import Satellites
from uav_simulator.frames import Quat, Vec3, wrap_pi
from uav_simulator.imperfections import Imperfections
from uav_simulator.vehicle.noise import SlowNoise
from uav_simulator.vehicle.quaternion import euler_zyx, from_yaw, multiply
from uav_simulator.vehicle.rigid_body import RigidBody

ALIGNED_AFTER_S = 23.0  # of power: tilt alignment; enough for modes that need no position
LOCATED_AFTER_S = 42.0  # of power: GPS fix, origin, position
PERFECT = Imperfections()
HOVER_M_S = 0.2  # slower is no travel
BEARING_RAD_SQRT_M = 0.05  # how fast the drift changes its direction
YAW_WALK_S = 100.0  # there and back
BROKEN_M_S = 0.015  # ArduCopter flown with this drift of its barometer sank by 1.18 m in 97 s


@dataclass(frozen=True)
class Estimate:
    """The estimate: position relative to the origin and velocity (ENU), attitude (FLU to ENU), body rates (FLU)."""

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


class Drift:
    """An error of position and heading that grows with the way flown, wanders and jumps now and then; zero before the first flight."""

    def __init__(self, imperfections: Imperfections, seed: int) -> None:
        self._imperfections = imperfections
        self._random = random.Random(f"ekf drift {seed}")  # noqa: S311 - repeatable on purpose
        self._turn_sign = self._random.choice((-1.0, 1.0))
        self._bearing_rad = self._random.uniform(-math.pi, math.pi)
        self._last: Vec3 | None = None
        self._jump_due_s = imperfections.jump_every_s
        self.offset: Vec3 = (0.0, 0.0, 0.0)
        self._flown_s = 0.0
        self._turned_rad = 0.0

    @property
    def yaw_rad(self) -> float:
        """Error of the estimated heading, radians."""
        walk_rad = math.radians(self._imperfections.yaw_walk_deg) * math.sin(math.pi * self._flown_s / YAW_WALK_S) ** 2
        return self._turned_rad + self._turn_sign * walk_rad

    def step(self, body: RigidBody, dt_s: float) -> None:
        """Advance with the body."""
        here, last = body.position, self._last or body.position
        self._last = here
        if body.on_ground:
            return
        # A standing vehicle's hover is no way: the wind moves it by centimetres.
        way_m = math.hypot(here[0] - last[0], here[1] - last[1]) if math.hypot(*body.velocity[:2]) > HOVER_M_S else 0.0
        limits = self._imperfections
        self._bearing_rad += self._random.gauss(0.0, BEARING_RAD_SQRT_M) * math.sqrt(way_m)
        self._move(limits.position_drift * way_m, self._bearing_rad)
        self._flown_s += dt_s
        self._turned_rad += self._turn_sign * math.radians(limits.yaw_drift_deg) * way_m / 100.0
        self._jump_due_s -= dt_s
        if limits.position_jump_m > 0.0 and self._jump_due_s <= 0.0:
            self._jump_due_s += max(limits.jump_every_s, 1.0)
            self._move(limits.position_jump_m, self._random.uniform(-math.pi, math.pi))

    def _move(self, length_m: float, bearing_rad: float) -> None:
        x, y, z = self.offset
        self.offset = (x + length_m * math.cos(bearing_rad), y + length_m * math.sin(bearing_rad), z)


class Leaning:
    """An error of roll and pitch, about the body's axes: a constant, as from an accelerometer's bias, and a slow walk."""

    def __init__(self, imperfections: Imperfections, seed: int) -> None:
        chance = random.Random(f"ekf tilt {seed}")  # noqa: S311 - repeatable on purpose
        bias_rad, walk_rad = math.radians(imperfections.tilt_bias_deg), math.radians(imperfections.tilt_walk_deg)
        self._bias_rad = (chance.choice((-bias_rad, bias_rad)), chance.choice((-bias_rad, bias_rad)))
        self._walk = SlowNoise(sigma=walk_rad, tau_s=30.0, limit=3.0 * walk_rad, seed=f"ekf tilt walk {seed}")

    def step(self, dt_s: float) -> Quat:
        """Advance by ``dt_s``; return the turn from the body's attitude to the estimated one."""
        walk = self._walk.step(dt_s)
        x, y = (0.5 * (bias + moved) for bias, moved in zip(self._bias_rad, walk, strict=False))
        return math.sqrt(1.0 - x * x - y * y), x, y, 0.0


class Barometer:
    """An error of height: noise, a slow drift that stays within bounds, and one that goes on as long as the vehicle is in the air.

    ``broken``: the height runs away by `BROKEN_M_S` more, the same way.
    """

    def __init__(self, imperfections: Imperfections, seed: int) -> None:
        self.broken = False
        noise_m, drift_m = imperfections.height_noise_m, imperfections.height_drift_m
        self._noise = SlowNoise(sigma=noise_m, tau_s=0.5, limit=3.0 * noise_m, seed=f"ekf height noise {seed}")
        self._drift = SlowNoise(sigma=drift_m, tau_s=60.0, limit=3.0 * drift_m, seed=f"ekf height drift {seed}")
        self._sign = random.Random(f"ekf height rate {seed}").choice((-1.0, 1.0))  # noqa: S311 - repeatable on purpose
        self._rate_m_s = imperfections.height_drift_m_s
        self._gone_m = 0.0

    def step(self, dt_s: float, *, flying: bool) -> tuple[float, float]:
        """Advance by ``dt_s``; return the error of the height, metres, and of the climb, m/s: a filter takes the drift for a climb."""
        rate_m_s = self._sign * (self._rate_m_s + BROKEN_M_S * self.broken) if flying else 0.0
        self._gone_m += rate_m_s * dt_s
        return self._noise.step(dt_s)[2] + self._drift.step(dt_s)[2] + self._gone_m, rate_m_s


class Estimator:
    """Adds the errors; without imperfections each axis stays within 1.7 cm, so the position within 3 cm."""

    def __init__(self, seed: int, imperfections: Imperfections = PERFECT) -> None:
        self._drift, self._leaning = Drift(imperfections, seed), Leaning(imperfections, seed)
        self.barometer = Barometer(imperfections, seed)
        self.satellites = Satellites(seed)
        self._position = SlowNoise(sigma=0.007, tau_s=20.0, limit=0.017, seed=f"ekf position {seed}")
        self._velocity = SlowNoise(sigma=0.01, tau_s=2.0, limit=0.03, seed=f"ekf velocity {seed}")
        self._yaw = SlowNoise(sigma=math.radians(0.3), tau_s=30.0, limit=math.radians(1.0), seed=f"ekf yaw {seed}")

    def step(self, body: RigidBody, dt_s: float) -> Estimate:
        """Return the estimate of a body's state."""
        dp, dv = self._position.step(dt_s), self._velocity.step(dt_s)
        self._drift.step(body, dt_s)
        up_m, climb_m_s = self.barometer.step(dt_s, flying=not body.on_ground)
        self.satellites.step(dt_s, flying=not body.on_ground)
        reckoned, reckoned_m_s = self.satellites.offset, self.satellites.velocity
        yaw, drift = self._yaw.step(dt_s)[0] + self._drift.yaw_rad, self._drift.offset
        if body.on_ground:
            dv = (0.0, 0.0, 0.0)  # zero-velocity updates hold the filter while the vehicle stands
        p, v = body.position, body.velocity
        return Estimate(
            position=(p[0] + dp[0] + drift[0] + reckoned[0], p[1] + dp[1] + drift[1] + reckoned[1], p[2] + dp[2] + drift[2] + up_m),
            velocity=(v[0] + dv[0] + reckoned_m_s[0], v[1] + dv[1] + reckoned_m_s[1], v[2] + dv[2] + climb_m_s),
            attitude=multiply(multiply(from_yaw(yaw), body.attitude), self._leaning.step(dt_s)),
            rates=body.rates,
            yaw_error_rad=yaw,
        )
