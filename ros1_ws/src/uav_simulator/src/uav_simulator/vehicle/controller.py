"""The cascade that flies the body: position and velocity to acceleration (50 Hz), attitude to body rates to rotors (400 Hz)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_simulator.frames import Quat, Vec3
from uav_simulator.vehicle.airframe import GRAVITY_M_S2, ROTORS, Airframe
from uav_simulator.vehicle.quaternion import tilted
from uav_simulator.vehicle.rigid_body import RigidBody

OFF = (0.0,) * ROTORS


@dataclass(frozen=True)
class Gains:
    """Feedback gains; each loop several times slower than the one inside it."""

    position_s: float = 1.2  # 1/s
    velocity_s: float = 3.0  # 1/s
    integral_s2: float = 1.0  # 1/s2
    attitude_s: float = 5.0  # 1/s, roll and pitch
    yaw_s: float = 3.0  # 1/s
    rate_s: float = 14.0  # 1/s
    max_accel_m_s2: float = 4.5
    max_tilt_rad: float = math.radians(30.0)
    max_rate_rad_s: float = 3.0


@dataclass(frozen=True)
class Reference:
    """Where the vehicle should be at this moment (map) and how it should move there."""

    position: Vec3
    velocity: Vec3
    accel: Vec3
    yaw_rad: float
    yaw_rate_rad_s: float = 0.0


@dataclass(frozen=True)
class AttitudeTarget:
    """What the inner loops hold: attitude, yaw rate fed forward, total thrust in newtons."""

    attitude: Quat
    yaw_rate_rad_s: float
    thrust_n: float


class PositionLoop:
    """Position and velocity errors to an attitude and a thrust; an integral carries the wind."""

    def __init__(self, airframe: Airframe, gains: Gains) -> None:
        self._airframe, self._gains = airframe, gains
        self._integral = (0.0, 0.0, 0.0)

    def restart(self) -> None:
        """Forget the integral, on the ground."""
        self._integral = (0.0, 0.0, 0.0)

    def step(self, reference: Reference, position: Vec3, velocity: Vec3, dt_s: float) -> AttitudeTarget:
        """Return what the inner loops should hold, from the estimated position and velocity (map)."""
        g = self._gains
        accel = []
        integral = []
        for rp, rv, ra, p, v, i in zip(
            reference.position, reference.velocity, reference.accel, position, velocity, self._integral, strict=True
        ):
            error = rv + g.position_s * (rp - p) - v
            i_new = max(-3.0, min(3.0, i + g.integral_s2 * error * dt_s))
            integral.append(i_new)
            accel.append(ra + g.velocity_s * error + i_new)
        self._integral = (integral[0], integral[1], integral[2])
        return self._target(accel[0], accel[1], accel[2], reference)

    def _target(self, ax: float, ay: float, az: float, reference: Reference) -> AttitudeTarget:
        g = self._gains
        az = max(-g.max_accel_m_s2, min(g.max_accel_m_s2, az)) + GRAVITY_M_S2
        horizontal = math.hypot(ax, ay)
        allowed = min(g.max_accel_m_s2, az * math.tan(g.max_tilt_rad))
        if horizontal > allowed:
            ax, ay = ax * allowed / horizontal, ay * allowed / horizontal
        length = math.sqrt(ax * ax + ay * ay + az * az)
        attitude = tilted((ax / length, ay / length, az / length), reference.yaw_rad)
        return AttitudeTarget(attitude, reference.yaw_rate_rad_s, self._airframe.mass_kg * length)


class AttitudeLoop:
    """Attitude error to body rates to rotor thrusts."""

    def __init__(self, airframe: Airframe, gains: Gains) -> None:
        self._gains = gains
        self._rate_gain = tuple(i * gains.rate_s for i in airframe.inertia_kg_m2)
        square = sum(x * x for x, _, _ in airframe.rotor_places)
        # Inverse of the rotors' thrust-to-torque matrix; its rows are orthogonal on a regular hexagon.
        kappa = airframe.rotor_torque_m * ROTORS
        self._mix = tuple((y / square, -x / square, spin / kappa) for x, y, spin in airframe.rotor_places)
        self._yaw_torque_limit = airframe.rotor_torque_m * airframe.hover_thrust_n * 0.5

    def step(self, target: AttitudeTarget, body: RigidBody) -> tuple[float, ...]:
        """Return the thrust commands of the rotors in newtons."""
        g = self._gains
        w, x, y, z = body.attitude
        tw, tx, ty, tz = target.attitude
        # Vector part of q^-1 q_target: half the rotation still to make, in body axes.
        sign = 2.0 if w * tw + x * tx + y * ty + z * tz >= 0.0 else -2.0
        ex = sign * (w * tx - x * tw - y * tz + z * ty)
        ey = sign * (w * ty - y * tw - z * tx + x * tz)
        ez = sign * (w * tz - z * tw - x * ty + y * tx)
        p, q, r = body.rates
        limit = g.max_rate_rad_s
        rate_p = max(-limit, min(limit, g.attitude_s * ex))
        rate_q = max(-limit, min(limit, g.attitude_s * ey))
        rate_r = max(-limit, min(limit, g.yaw_s * ez + target.yaw_rate_rad_s))
        torque_x = self._rate_gain[0] * (rate_p - p)
        torque_y = self._rate_gain[1] * (rate_q - q)
        torque_z = 0.5 * self._rate_gain[2] * (rate_r - r)
        torque_z = max(-self._yaw_torque_limit, min(self._yaw_torque_limit, torque_z))
        base = target.thrust_n / ROTORS
        return tuple([base + torque_x * mx + torque_y * my + torque_z * mz for mx, my, mz in self._mix])
