"""The body that ArduPilot flies: a step for each packet, an answer for each step, and nothing without a packet.

ArduPilot waits for the answer before it goes on, and the simulator's clock is the body's time: so both keep pace, whatever the machine
does. Accelerometers and gyros are the body's motion over the step, so that they agree with it also where it touches the ground.
"""

from __future__ import annotations

import contextlib
import logging
import select
import socket
import time
from dataclasses import dataclass

from uav_simulator.ardupilot.motors import HexaX, thrusts_n
from uav_simulator.ardupilot.protocol import PORT, BodyState, MotorPacket, answer, options, parse_packet
from uav_simulator.autopilot.types import LandedState
from uav_simulator.contacts import CRUISE_HEIGHT_M
from uav_simulator.errors import SimulatorError
from uav_simulator.frames import Vec3, frd_from_flu, ned_from_enu, quat_ned_frd_from_enu_flu
from uav_simulator.sensors.faults import SensorMode
from uav_simulator.vehicle.airframe import GRAVITY_M_S2
from uav_simulator.vehicle.hexacopter import STEP_S
from uav_simulator.vehicle.noise import Wind
from uav_simulator.vehicle.quaternion import rotate, rotation_vector
from uav_simulator.vehicle.rigid_body import ZERO, RigidBody

BUFFER = 4096
WAIT_S = 0.1  # wall clock that one call of `tick` waits for a packet
GROUND_DECEL_M_S2 = 60.0  # a softer landing than the accelerometers' range of 16 g
LEAST_STEPS, MOST_STEPS = 1, 40  # a tick; 50 to 2000 Hz
AIRBORNE_M = 0.1
SILENCE_S = 10.0  # wall clock; then, and so often, it is told

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Received:
    """A packet and its sender."""

    packet: MotorPacket
    peer: tuple[str, int]

    def repeats(self, other: _Received) -> bool:
        return self.peer == other.peer and self.packet.frame == other.packet.frame


class ArduPilotVehicle:
    """Serves one ArduPilot; one that is restarted finds the body where it is, and its own time at zero."""

    def __init__(self, *, seed: int, home: Vec3 = ZERO, port: int = PORT, address: str = "127.0.0.1") -> None:
        """Listen on UDP; raises SimulatorError when the port is taken."""
        self._airframe = HexaX()
        self.body = RigidBody(self._airframe, home, 0.0, ground_decel_m_s2=GROUND_DECEL_M_S2)
        self._wind = Wind(seed=seed)
        self._wind_m_s = ZERO
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((address, port))
        except OSError as error:
            self._socket.close()
            raise SimulatorError(f"UDP port {port} on {address} for ArduPilot can't be used: {error.strerror}") from error
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        self._tell_wall_s = time.monotonic() + SILENCE_S
        self._served: _Received | None = None
        self._next: _Received | None = None  # taken from the socket behind the repetitions of the last one
        self._answer = b""
        self._time_s = self._session_s = 0.0
        self._steps = self._steps_done = 0
        self._high = False

    @property
    def landed_state(self) -> LandedState:
        """The landed state by the body's height and the flight so far: ArduPilot does not report its intention."""
        height = self.body.position[2]
        if self.body.on_ground or (height < AIRBORNE_M and not self._high):
            return LandedState.ON_GROUND
        if height >= CRUISE_HEIGHT_M:
            return LandedState.IN_AIR
        return LandedState.LANDING if self._high else LandedState.TAKING_OFF

    def tick(self, now_s: float, dt_s: float) -> bool:
        """Handle packets until the tick is complete; False when none has come for a while."""
        until_s = time.monotonic() + WAIT_S
        while True:
            received = self._receive(until_s)
            if received is None:
                self._tell_silence()
                return False
            if self._take(received, dt_s) and self._steps_done == self._steps:
                self._steps_done = 0
                self._time_s = now_s
                self._note_height()
                return True

    @property
    def estimator(self) -> None:
        """Return None: it is not the simulator's."""
        return None

    def expose(self, wind: SensorMode, pilot: SensorMode) -> None:
        """Do nothing: wind and pilot are those of the autopilot that flies."""

    def late_s(self, now_s: float) -> float:  # noqa: ARG002
        """ArduPilot waits for each answer."""
        return 0.0

    def close(self) -> None:
        """Close the UDP socket on which ArduPilot sends its servos."""
        self._socket.close()

    def _receive(self, until_s: float) -> _Received | None:
        """Return the next packet; None when there is none in time."""
        received, self._next = self._next, None
        while received is None and (rest_s := until_s - time.monotonic()) > 0.0:
            readable, _, _ = select.select([self._socket], [], [], rest_s)
            received = self._read() if readable else None
        return received

    def _read(self) -> _Received | None:
        """Return the packet that waits in the socket; None if there is none, or something else."""
        # A peer that has gone makes a call fail (ICMP port unreachable); the next one is waited for.
        with contextlib.suppress(BlockingIOError, ConnectionError):
            data, peer = self._socket.recvfrom(BUFFER)
            packet = parse_packet(data)
            if packet is not None:
                self._tell_wall_s = time.monotonic() + SILENCE_S
                return _Received(packet, peer)
        return None

    def _tell_silence(self) -> None:
        if time.monotonic() >= self._tell_wall_s:
            self._tell_wall_s += SILENCE_S
            log.warning("no motor outputs on UDP port %d for %g s: does ArduPilot run with %s?", self.port, SILENCE_S, options(self.port))

    def _take(self, received: _Received, dt_s: float) -> bool:
        """Make the packet's step and answer; one that comes twice gets its answer again. Return whether there was a step."""
        last, packet = self._served, received.packet
        fresh = last is None or not received.repeats(last)
        if fresh:
            if last is None or received.peer != last.peer or packet.frame < last.packet.frame:  # it has been restarted
                self._session_s = self._time_s + self._steps_done * (dt_s / max(self._steps, 1))
            self._served = received
            if self._steps_done == 0:
                self._steps = min(max(round(dt_s * packet.rate_hz), LEAST_STEPS), MOST_STEPS)
                self._wind_m_s = self._wind.step(dt_s)
            self._step(packet, dt_s / self._steps)
        self._drop_repetitions(received)
        with contextlib.suppress(BlockingIOError, ConnectionError):
            self._socket.sendto(self._answer, received.peer)
        return fresh

    def _drop_repetitions(self, received: _Received) -> None:
        """Drop what ArduPilot has repeated, once a second, while time was held.

        One answer is enough: it would take each further one for the answer to its next packet, and fly by a state that is older by
        a step from then on.
        """
        while self._next is None and select.select([self._socket], [], [], 0.0)[0]:
            another = self._read()
            self._next = another if another is not None and not another.repeats(received) else None

    def _step(self, packet: MotorPacket, dt_s: float) -> None:
        body = self.body
        velocity, attitude = body.velocity, body.attitude
        commands = thrusts_n(packet.pwm_us, self._airframe.rotor_max_n)
        parts = max(1, round(dt_s / STEP_S))
        for _ in range(parts):
            body.step(dt_s / parts, commands, self._wind_m_s)
        self._steps_done += 1
        forces = [(after - before) / dt_s for after, before in zip(body.velocity, velocity, strict=True)]
        w, x, y, z = body.attitude
        felt = rotate((w, -x, -y, -z), (forces[0], forces[1], forces[2] + GRAVITY_M_S2))
        turn = rotation_vector(attitude, body.attitude)
        self._answer = answer(
            BodyState(
                time_s=round(self._time_s + self._steps_done * dt_s - self._session_s, 9),
                gyro_rad_s=frd_from_flu((turn[0] / dt_s, turn[1] / dt_s, turn[2] / dt_s)),
                accel_m_s2=frd_from_flu(felt),
                position_m=ned_from_enu(body.position),
                velocity_m_s=ned_from_enu(body.velocity),
                attitude=quat_ned_frd_from_enu_flu(body.attitude),
            )
        )

    def _note_height(self) -> None:
        if self.body.on_ground:
            self._high = False
        elif self.body.position[2] >= CRUISE_HEIGHT_M:
            self._high = True
