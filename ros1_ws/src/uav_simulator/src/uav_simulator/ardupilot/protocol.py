"""The JSON interface of ArduPilot's simulator: motor outputs come as a packet, the body's state goes back as a line of JSON.

Little endian: uint16 magic 18458, uint16 frame rate (Hz), uint32 frame count, 16 x uint16 PWM (microseconds); with SERVO_32_ENABLE the
magic is 29569 and 32 outputs follow. The answer: one JSON object between newlines, north-east-down and forward-right-down.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass

from uav_simulator.frames import Quat, Vec3

PORT, PORTS_OF_INSTANCE = 9002, 10
"""UDP port where ArduPilot's simulator looks for the body, and by how much it is above for each further instance of it on a machine."""
OUTPUTS_OF_MAGIC = {18458: 16, 29569: 32}
_HEAD = struct.Struct("<HHI")


def options(port: int, instance: int | None = None) -> str:
    """Return the options by which ArduPilot's simulator looks for the body at a port; ``instance``: the one that its other ports say.

    Its command line (AP_HAL_SITL, SITL_cmdline.cpp): ``-I N`` puts every port 10 N above; ``--sim-port-out`` names this one.
    """
    number, rest = divmod(port - PORT, PORTS_OF_INSTANCE)
    own = max(number, 0) if instance is None else instance
    other = "" if rest == 0 and number == own else f" --sim-port-out {port}"
    return f"--model JSON:127.0.0.1 -I{own}{other}"


@dataclass(frozen=True)
class MotorPacket:
    """What ArduPilot sends each step."""

    rate_hz: int
    frame: int
    pwm_us: tuple[int, ...]


@dataclass(frozen=True)
class BodyState:
    """The reply that it expects: seconds of the body's time, NED and FRD, SI units, unit quaternion (w x y z)."""

    time_s: float
    gyro_rad_s: Vec3
    accel_m_s2: Vec3
    position_m: Vec3
    velocity_m_s: Vec3
    attitude: Quat


def parse_packet(data: bytes) -> MotorPacket | None:
    """Read a packet; None for anything else."""
    if len(data) < _HEAD.size:
        return None
    magic, rate_hz, frame = _HEAD.unpack_from(data)
    outputs = OUTPUTS_OF_MAGIC.get(magic)
    if outputs is None or len(data) != _HEAD.size + 2 * outputs:
        return None
    return MotorPacket(rate_hz, frame, struct.unpack_from(f"<{outputs}H", data, _HEAD.size))


def answer(state: BodyState) -> bytes:
    """Return the line that answers a packet."""
    fields = {
        "timestamp": state.time_s,
        "imu": {"gyro": state.gyro_rad_s, "accel_body": state.accel_m_s2},
        "position": state.position_m,
        "velocity": state.velocity_m_s,
        "quaternion": state.attitude,
    }
    return b"\n" + json.dumps(fields, separators=(",", ":"), allow_nan=False).encode("ascii") + b"\n"
