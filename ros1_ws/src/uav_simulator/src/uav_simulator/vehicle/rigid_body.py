"""The rigid body with six rotors: state and equations of motion, integrated at 400 Hz (semi-implicit Euler).

Frames: position, velocity in map (ENU); body rates, rotor places in body (FLU). The reference point touches the ground at z = 0.
"""

from __future__ import annotations

import math

from uav_simulator.frames import Quat, Vec3
from uav_simulator.vehicle.airframe import GRAVITY_M_S2, ROTORS, Airframe
from uav_simulator.vehicle.quaternion import euler_zyx, from_yaw

ZERO: Vec3 = (0.0, 0.0, 0.0)


class RigidBody:
    """A hexacopter in the air or on the ground."""

    def __init__(self, airframe: Airframe, position: Vec3 = ZERO, yaw_rad: float = 0.0, *, ground_decel_m_s2: float = math.inf) -> None:
        """``ground_decel_m_s2``: how hard the ground stops a body that comes down."""
        self.airframe = airframe
        self._ground_decel_m_s2 = ground_decel_m_s2
        self.position: Vec3 = position
        self.velocity: Vec3 = ZERO
        self.attitude: Quat = from_yaw(yaw_rad)
        self.rates: Vec3 = ZERO
        self.specific_force: Vec3 = (0.0, 0.0, GRAVITY_M_S2)  # what an accelerometer feels, body
        self.thrusts: tuple[float, ...] = (0.0,) * ROTORS
        self.stopped_rotor: int | None = None
        """A rotor whose motor has failed, whatever it is commanded."""
        self.on_ground = position[2] <= 0.0
        self._places = airframe.rotor_places

    def step(self, dt_s: float, rotor_commands_n: tuple[float, ...], wind: Vec3 = ZERO) -> None:
        """Advance by one step with the commanded rotor thrusts (N, clipped to what a rotor can do) and the wind (map, m/s)."""
        frame = self.airframe
        total, torque = self._turn_rotors(dt_s, rotor_commands_n)
        w, x, y, z = self.attitude
        up = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
        vx, vy, vz = self.velocity
        ax, ay, az = vx - wind[0], vy - wind[1], vz - wind[2]
        drag = (frame.drag_linear_kg_s + frame.drag_square_kg_m * math.sqrt(ax * ax + ay * ay + az * az)) / frame.mass_kg
        lift = total / frame.mass_kg
        fx, fy, fz = lift * up[0] - drag * ax, lift * up[1] - drag * ay, lift * up[2] - drag * az
        vx, vy, vz = vx + fx * dt_s, vy + fy * dt_s, vz + (fz - GRAVITY_M_S2) * dt_s
        px, py, pz = self.position
        px, py, pz = px + vx * dt_s, py + vy * dt_s, pz + vz * dt_s
        if pz <= 0.0 and vz <= 0.0:
            if vz + self._ground_decel_m_s2 * dt_s >= 0.0:
                self._rest(*(self.position[:2] if self.on_ground else (px, py)))
                return
            vz += (self._ground_decel_m_s2 + GRAVITY_M_S2) * dt_s
        self.on_ground = False
        self.position, self.velocity = (px, py, pz), (vx, vy, vz)
        self._turn(dt_s, torque)
        self.specific_force = _world_to_body(self.attitude, (fx, fy, fz))

    def bounce(self, normal: Vec3, depth_m: float) -> None:
        """Meet a surface: leave it by ``depth_m`` along its normal (map, unit) and lose most of the speed into it."""
        into = sum(v * n for v, n in zip(self.velocity, normal, strict=True))
        if into < 0.0:
            vx, vy, vz = (v - 1.2 * into * n for v, n in zip(self.velocity, normal, strict=True))
            self.velocity = (vx, vy, vz)
        px, py, pz = (p + depth_m * n for p, n in zip(self.position, normal, strict=True))
        self.position = (px, py, max(pz, 0.0))

    def _turn_rotors(self, dt_s: float, commands_n: tuple[float, ...]) -> tuple[float, Vec3]:
        """Let the rotors follow their commands (first-order lag); return total thrust and torque (body)."""
        gain = dt_s / self.airframe.rotor_lag_s
        limit, kappa = self.airframe.rotor_max_n, self.airframe.rotor_torque_m
        total = tx = ty = tz = 0.0
        thrusts = []
        if self.stopped_rotor is not None:
            commands_n = tuple(0.0 if rotor == self.stopped_rotor else command for rotor, command in enumerate(commands_n))
        for now, command, (x, y, spin) in zip(self.thrusts, commands_n, self._places, strict=True):
            wanted = 0.0 if command < 0.0 else min(command, limit)
            thrust = now + (wanted - now) * gain
            thrusts.append(thrust)
            total += thrust
            tx += y * thrust
            ty -= x * thrust
            tz += spin * kappa * thrust
        self.thrusts = tuple(thrusts)
        return total, (tx, ty, tz)

    def _turn(self, dt_s: float, torque: Vec3) -> None:
        """Integrate Euler's equations and the attitude."""
        ix, iy, iz = self.airframe.inertia_kg_m2
        damping = self.airframe.spin_drag_n_m_s
        p, q, r = self.rates
        p, q, r = (
            p + dt_s * (torque[0] - damping * p - (iz - iy) * q * r) / ix,
            q + dt_s * (torque[1] - damping * q - (ix - iz) * r * p) / iy,
            r + dt_s * (torque[2] - damping * r - (iy - ix) * p * q) / iz,
        )
        self.rates = (p, q, r)
        h = 0.5 * dt_s
        w, x, y, z = self.attitude
        w, x, y, z = (
            w - h * (x * p + y * q + z * r),
            x + h * (w * p + y * r - z * q),
            y + h * (w * q - x * r + z * p),
            z + h * (w * r + x * q - y * p),
        )
        n = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        self.attitude = (w * n, x * n, y * n, z * n)

    def _rest(self, px: float, py: float) -> None:
        """Stand on the ground: the gear levels the vehicle and friction holds it."""
        self.on_ground = True
        self.position, self.velocity, self.rates = (px, py, 0.0), ZERO, ZERO
        self.attitude = from_yaw(euler_zyx(self.attitude)[2])
        self.specific_force = (0.0, 0.0, GRAVITY_M_S2)


def _world_to_body(q: Quat, v: Vec3) -> Vec3:
    w, x, y, z = q[0], -q[1], -q[2], -q[3]
    vx, vy, vz = v
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx
