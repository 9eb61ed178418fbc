"""A peer that speaks ArduPilot's JSON interface byte for byte, with a simple controller in place of ArduPilot's."""

from __future__ import annotations

import json
import math
import socket
import struct
import threading

MOTORS = ((90.0, 1), (-90.0, -1), (-30.0, 1), (150.0, -1), (30.0, -1), (-150.0, 1))  # clockwise from forward; 1: clockwise
HOVER = 14.0 * 9.80665 / (6 * 45.0)  # part of the greatest thrust


def pwm_of(part: float) -> int:
    """Return the output for a part of the greatest thrust: what MOT_THST_EXPO 0.65, MOT_SPIN_MIN 0.15 and MOT_SPIN_MAX 0.95 make of it."""
    part = min(max(part, 0.0), 1.0)
    expo = 0.65
    u = (-(1 - expo) + math.sqrt((1 - expo) ** 2 + 4 * expo * part)) / (2 * expo)
    return round(1000 + 1000 * (0.15 + 0.8 * u))


def packet(frame, pwm, *, rate_hz=400, magic=18458):
    # magic, frame rate: uint16; frame count: uint32; 16 outputs: uint16; all little endian
    return struct.pack("<HHI16H", magic, rate_hz, frame, *pwm, *([0] * (16 - len(pwm))))


class Peer:
    """Steps the body over UDP, and holds a height and a heading (NED, FRD) with it."""

    def __init__(self, port, *, rate_hz=400):
        self.rate_hz, self.frame = rate_hz, 0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(10.0)
        self.socket.connect(("127.0.0.1", port))
        self.state = None

    def step(self, pwm):
        """Exchange one frame; return the body's state."""
        self.socket.send(packet(self.frame, pwm, rate_hz=self.rate_hz))
        self.frame += 1
        line = self.socket.recv(65536)
        assert line.startswith(b"\n")
        assert line.endswith(b"\n")
        self.state = json.loads(line)
        return self.state

    def fly(self, height_m, yaw_rad, seconds, *, until=None, states=None):
        """Fly to a height and a heading; end early once ``until`` holds of the state; ``states`` gets all of them."""
        for _ in range(round(seconds * self.rate_hz)):
            state = self.step(self.outputs(height_m, yaw_rad))
            if states is not None:
                states.append(state)
            if until is not None and until(state):
                return
        if until is not None:
            raise AssertionError(f"not in {seconds} s: {self.state}")

    def outputs(self, height_m, yaw_rad):
        if self.state is None:
            return [1000] * 6
        w, x, y, z = self.state["quaternion"]
        p, q, r = self.state["imu"]["gyro"]
        down, speed_down = self.state["position"][2], self.state["velocity"][2]
        climb = min(max(1.2 * (height_m + down), -0.6), 1.5)
        lift = HOVER * (1.0 + 0.25 * (climb + speed_down))
        # Level, with the velocity damped: pitch up slows forward motion.
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        north, east = self.state["velocity"][:2]
        forward, right = north * math.cos(yaw) + east * math.sin(yaw), -north * math.sin(yaw) + east * math.cos(yaw)
        roll, pitch = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), math.asin(2 * (w * y - z * x))
        torque_roll = 0.10 * (-0.1 * right - roll) - 0.045 * p
        torque_pitch = 0.10 * (0.1 * forward - pitch) - 0.045 * q
        error = (yaw_rad - yaw + math.pi) % (2 * math.pi) - math.pi
        torque_yaw = 0.15 * min(max(error, -0.5), 0.5) - 0.15 * r
        parts = []
        for angle_deg, clockwise in MOTORS:
            a = math.radians(angle_deg)
            # Right rotors roll to the left, front rotors pitch up, counter-clockwise rotors turn the body clockwise.
            parts.append(lift - math.sin(a) * torque_roll + math.cos(a) * torque_pitch - clockwise * torque_yaw)
        return [pwm_of(part) for part in parts]


class InThread:
    """Runs what a peer does beside the test, which ticks the vehicle meanwhile."""

    def __init__(self, work):
        self.error = None
        self._work = work
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        try:
            self._work()
        except Exception as error:  # noqa: BLE001 - told in the test's thread
            self.error = error

    @property
    def running(self):
        return self._thread.is_alive()

    def join(self):
        self._thread.join(20.0)
        if self.error is not None:
            raise self.error
