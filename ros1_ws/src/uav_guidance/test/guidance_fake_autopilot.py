"""A small autopilot for tests: a real MAVLink peer over TCP that behaves, in what the guidance can see, like ArduCopter 4.6.

It owns the simulated time: ``tick`` moves vehicle and clock on by 20 ms. Its transcript keeps what the companion sent, runs of equal
setpoint masks being one entry.
"""

from __future__ import annotations

import math
import select
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

TICK_S = 0.02
SPOOL_UP_S = 2.4
CLIMB_M_S, SINK_M_S = 1.5, 1.0
ACCEL_M_S2, TOP_M_S, YAW_RAD_S = 2.5, 5.0, 1.2
GROUND_DISARM_S, LANDED_DISARM_S = 10.0, 0.5
CHECK_PERIOD_S = 1.0
FOLLOWED_MASKS = {0x0DF8, 0x09F8, 0x05F8, 0x01F8, 0x0000}
HOME = (473977418, 85455939, 488000)
STABILIZE, GUIDED, LOITER, LAND = 0, 4, 5, 9
KNOWN_MODES = {0, 3, 4, 5, 6, 9, 17}


@dataclass
class Body:
    """The vehicle; NED, metres, yaw clockwise from north."""

    place: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    speed: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    yaw: float = 0.3
    armed: bool = False
    mode: int = 0
    landed: int = 1


FORCE_MAGIC = 21196.0


class FakeVehicle:
    """The autopilot without its link: ``hear`` takes messages, ``send`` gets them, ``tick`` moves time on."""

    def __init__(self, send: Callable[[Any], None], *, ready_s: float = 1.0, start_s: float = 100.0) -> None:
        self.body = Body()
        self.transcript: list[tuple[Any, ...]] = []
        self.now_s = start_s
        self.refuse_arming = ""
        self.says_why = True
        self.refuse_guided = False
        self.kind = (13, 3)
        """HEARTBEAT's type and autopilot."""
        self.system_status = 4
        self.lost_answers: dict[str, int] = {}
        """How many answers to a command get lost from now on, by its name."""
        self.deaf = False
        self.stuck = False
        self.position_check_s: float | None = None
        """Since power-up, when its checks find a position, which GUIDED needs; they run once a second. None: at once, as the others."""
        self.fix: int | None = 3
        """GPS_FIX_TYPE; None: the GPS says nothing."""
        self.estimator = 831
        """EKF_STATUS_FLAGS: all that there is with a position."""
        self.setpoint: tuple[float, float, float, float] | None = None
        self.heartbeats_heard = 0
        self._send = send
        self._ready_from_s = start_s + ready_s
        self._intervals: dict[int, tuple[float, float]] = {}
        self._takeoff: tuple[float, float] | None = None
        self._climb_to: float | None = None
        self._late_text: tuple[float, str] | None = None
        self._late_severity = 2
        self._booted_s = 0.0
        self._told_ready = False
        self._checked_s = -math.inf
        self._armed_s = self._touched_s = self._heartbeat_s = 0.0

    @property
    def enu(self) -> tuple[float, float, float]:
        north, east, down = self.body.place
        return (east, north, -down)

    def pilot(self, mode: int) -> None:
        """The pilot takes another mode."""
        self._change_mode(mode)

    def failsafe(self, mode: int, text: str, *, severity: int = 4, late_s: float = 0.0) -> None:
        """A failsafe takes another mode and says so, ``late_s`` after it."""
        self.system_status = 5
        self._late_text, self._late_severity = (self.now_s + late_s, text), severity
        self._change_mode(mode)

    def say(self, severity: int, text: str) -> None:
        self._send(mavlink.MAVLink_statustext_message(severity, text.encode()))

    def restart(self, mode: int) -> None:
        """The autopilot's computer restarts in the air: streams, boot time, what it was told, and where it counts from."""
        self.forget_streams()
        self._booted_s = self.now_s
        self.body.armed = self.body.armed and self.body.landed != 1
        self._change_mode(mode)
        self.body.place = [0.0, 0.0, self.body.place[2]]

    def forget_streams(self) -> None:
        self._intervals.clear()

    def tick(self) -> None:
        self.now_s += TICK_S
        if self.position_check_s is None or self.now_s - self._checked_s >= CHECK_PERIOD_S:
            self._checked_s, self._told_ready = self.now_s, self.ready
        self._move()
        self._speak()

    # ---- what it hears -------------------------------------------------------------------------------------------------

    def hear(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.heartbeats_heard += 1
        elif kind == "SET_POSITION_TARGET_LOCAL_NED":
            self._hear_setpoint(message)
        elif kind == "COMMAND_LONG" and not self.deaf:
            result = self._obey(message)
            name = mavlink.enums["MAV_CMD"][message.command].name
            left = self.lost_answers.get(name, 0)
            self.lost_answers[name] = max(left - 1, 0)
            if left:
                return
            self._send(mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, 1, 191))

    def _note(self, *entry: Any) -> None:
        if not self.transcript or self.transcript[-1] != entry or entry[0] != "setpoints":
            self.transcript.append(entry)

    def _hear_setpoint(self, message: Any) -> None:
        self._note("setpoints", hex(message.type_mask), self.body.landed)
        if self.body.mode != GUIDED or not self.body.armed or message.type_mask not in FOLLOWED_MASKS:
            return
        if self.body.landed == 1:
            self._takeoff = None  # silently cancelled
        else:
            self._climb_to = None
            self.setpoint = (message.x, message.y, message.z, message.yaw)

    def _obey(self, message: Any) -> int:
        if message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self._intervals[int(message.param1)] = (message.param2 * 1e-6, 0.0)
            return mavlink.MAV_RESULT_ACCEPTED
        parameters = [message.param1, message.param2, message.param7]
        self._note(mavlink.enums["MAV_CMD"][message.command].name, *parameters)
        return {
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
        }[message.command](*parameters)

    def _set_mode(self, use_custom: float, mode: float, _: float) -> int:
        if use_custom != 1.0:
            return mavlink.MAV_RESULT_DENIED
        if int(mode) not in KNOWN_MODES or (int(mode) == GUIDED and self.refuse_guided):
            return mavlink.MAV_RESULT_FAILED
        self._change_mode(int(mode))
        return mavlink.MAV_RESULT_ACCEPTED

    def _change_mode(self, mode: int) -> None:
        self.body.mode = mode
        self.setpoint = self._climb_to = self._takeoff = None
        self._heartbeat_s = 0.0

    def _arm(self, wanted: float, magic: float, __: float) -> int:
        body = self.body
        if not wanted:
            if body.landed != 1 and magic != FORCE_MAGIC:
                return mavlink.MAV_RESULT_FAILED
            body.armed, body.landed, self._takeoff = False, 1, None
            return mavlink.MAV_RESULT_ACCEPTED
        why = self.refuse_arming or ("" if self.ready else "GPS 1: waiting for home")
        if why:
            # As on the real one, the text leaves after the answer.
            self._late_text = (self.now_s + 0.1, f"Arm: {why}") if self.says_why else None
            return mavlink.MAV_RESULT_FAILED
        body.armed, self._armed_s = True, self.now_s
        self._send_home()
        return mavlink.MAV_RESULT_ACCEPTED

    def _take_off(self, _: float, __: float, height: float) -> int:
        if not self.body.armed or self.body.mode != GUIDED or self.body.landed != 1:
            return mavlink.MAV_RESULT_FAILED
        lift_off_s = self.now_s + SPOOL_UP_S if self._takeoff is None else self._takeoff[0]  # repeated: the motors go on spooling up
        self._takeoff = (lift_off_s, height)
        return mavlink.MAV_RESULT_ACCEPTED

    # ---- what it does --------------------------------------------------------------------------------------------------

    @property
    def ready(self) -> bool:
        if self.body.mode == GUIDED and self.position_check_s is not None and self.now_s < self._booted_s + self.position_check_s:
            return False
        return self.now_s >= self._ready_from_s

    def _move(self) -> None:
        body = self.body
        if body.landed == 1:
            self._stand()
            return
        wanted = [0.0, 0.0, 0.0]
        if body.mode == LAND:
            body.landed, wanted[2] = 4, SINK_M_S
        elif self._climb_to is not None:
            body.landed, wanted[2] = 3, -min(CLIMB_M_S, 0.2 + body.place[2] + self._climb_to)
            if body.place[2] <= -self._climb_to + 0.05:
                self._climb_to = None
        else:
            body.landed = 2
            if self.setpoint is not None:
                wanted = self._to_setpoint(self.setpoint)
        for axis in range(3):
            change = min(max(wanted[axis] - body.speed[axis], -ACCEL_M_S2 * TICK_S), ACCEL_M_S2 * TICK_S)
            body.speed[axis] = 0.0 if self.stuck else body.speed[axis] + change
            body.place[axis] += body.speed[axis] * TICK_S
        if body.place[2] >= 0.0 and body.speed[2] > 0.0:
            body.place[2], body.speed, body.landed, self._touched_s = 0.0, [0.0] * 3, 1, self.now_s

    def _stand(self) -> None:
        body = self.body
        if self._takeoff is not None:
            if self.now_s >= self._takeoff[0]:
                self._climb_to, self._takeoff, body.landed = self._takeoff[1], None, 3
            return
        idle_since_s = max(self._armed_s, self._touched_s)
        if self.now_s > (self._touched_s + LANDED_DISARM_S if body.mode == LAND else idle_since_s + GROUND_DISARM_S):
            body.armed = False

    def _to_setpoint(self, setpoint: tuple[float, float, float, float]) -> list[float]:
        body = self.body
        offset = [setpoint[axis] - body.place[axis] for axis in range(3)]
        distance = math.hypot(*offset)
        speed = min(1.2 * distance, math.sqrt(2.0 * 0.5 * ACCEL_M_S2 * distance), TOP_M_S)
        turn = math.remainder(setpoint[3] - body.yaw, math.tau)
        body.yaw = math.remainder(body.yaw + min(max(turn, -YAW_RAD_S * TICK_S), YAW_RAD_S * TICK_S), math.tau)
        return [speed * part / distance if distance > 1e-6 else 0.0 for part in offset]

    # ---- what it says --------------------------------------------------------------------------------------------------

    def _speak(self) -> None:
        if self.now_s - self._heartbeat_s >= 1.0:
            self._heartbeat_s = self.now_s
            base_mode = 1 | (128 if self.body.armed else 0)
            self._send(mavlink.MAVLink_heartbeat_message(*self.kind, base_mode, self.body.mode, self.system_status, 3))
        if self._late_text is not None and self.now_s >= self._late_text[0]:
            self.say(self._late_severity, self._late_text[1])
            self._late_text, self._late_severity = None, 2
        for number, (period_s, last_s) in list(self._intervals.items()):
            if self.now_s - last_s >= period_s - 1e-6:
                self._intervals[number] = (period_s, self.now_s)
                self._say(number)

    def _say(self, number: int) -> None:
        body, boot_ms = self.body, int((self.now_s - self._booted_s) * 1000.0)
        if number == mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            self._send(mavlink.MAVLink_local_position_ned_message(boot_ms, *body.place, *body.speed))
        elif number == mavlink.MAVLINK_MSG_ID_ATTITUDE:
            self._send(mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, body.yaw, 0.0, 0.0, 0.0))
        elif number == mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE:
            self._send(mavlink.MAVLink_extended_sys_state_message(0, body.landed))
        elif number == mavlink.MAVLINK_MSG_ID_SYS_STATUS:
            health = 0x10000000 if self._told_ready else 0
            self._send(mavlink.MAVLink_sys_status_message(0x10000000, 0x10000000, health, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0))
        elif number == mavlink.MAVLINK_MSG_ID_GPS_RAW_INT and self.fix is not None:
            boot_us = boot_ms * 1000
            self._send(mavlink.MAVLink_gps_raw_int_message(boot_us, self.fix, *HOME, 121, 200, 65535, 65535, 12))
        elif number == mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT:
            self._send(mavlink.MAVLink_ekf_status_report_message(self.estimator, 0.05, 0.05, 0.05, 0.05, 0.0))
        elif number == mavlink.MAVLINK_MSG_ID_HOME_POSITION and self.ready:
            self._send_home()
        elif number == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN and self.ready:
            self._send(mavlink.MAVLink_gps_global_origin_message(*HOME))

    def _send_home(self) -> None:
        # ArduPilot leaves the local fields at zero.
        self._send(mavlink.MAVLink_home_position_message(*HOME, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0))


class FakeAutopilot(FakeVehicle):
    """The vehicle behind a TCP port of loopback, for one client, on a clock that runs ``rate`` times as fast as the wall's."""

    def __init__(self, *, on_clock: Callable[[float], None], rate: float = 5.0) -> None:
        super().__init__(self._transmit)
        self._on_clock, self._rate = on_clock, rate
        self.keep_pace: Callable[[], bool] = lambda: True
        """Tells whether time may go on; asked before each tick."""
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._port = self._listener.getsockname()[1]
        self._client: socket.socket | None = None
        self._mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._ended = threading.Event()
        self._lock = threading.RLock()
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def url(self) -> str:
        return f"tcp:127.0.0.1:{self._port}"

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join(2.0)
        self.drop_client()
        self._listener.close()

    def drop_client(self) -> None:
        with self._lock:
            if self._client is not None:
                self._client.close()
            self._client = None
            self.forget_streams()

    def close_port(self) -> None:
        """Be gone: connections are refused until ``open_port``."""
        self._listener.close()
        self.drop_client()

    def open_port(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", self._port))

    def pilot(self, mode: int) -> None:
        with self._lock:
            super().pilot(mode)

    def _run(self) -> None:
        next_wall_s = time.monotonic()
        while not self._ended.is_set():
            next_wall_s = max(next_wall_s + TICK_S / self._rate, time.monotonic() - 0.1)
            self._serve(0.0)  # also where time is to catch up: what has arrived is answered before time goes on
            while (left_s := next_wall_s - time.monotonic()) > 0.0:
                self._serve(left_s)
            if not self.keep_pace():
                continue
            with self._lock:
                self.tick()
            self._on_clock(self.now_s)

    def _serve(self, wait_s: float) -> None:
        client = self._client
        try:
            ready, _, _ = select.select([client if client is not None else self._listener], [], [], wait_s)
            data = client.recv(4096) if ready and client is not None else None
        except (OSError, ValueError):  # closed by another thread
            data = b""
            time.sleep(wait_s)
        with self._lock:
            if client is None:
                self._accept()
            elif data == b"":
                self.drop_client()
            for message in (self._mav.parse_buffer(data) if data else None) or ():
                assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 191)
                self.hear(message)

    def _accept(self) -> None:
        try:
            self._listener.settimeout(0.0)
            self._client, _ = self._listener.accept()
        except OSError:  # no client connects, or the port is closed
            return
        self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._mav.robust_parsing = True

    def _transmit(self, message: Any) -> None:
        if self._client is None:
            return
        try:
            self._client.sendall(message.pack(self._mav))
            self._mav.seq = (self._mav.seq + 1) % 256
        except OSError:
            self.drop_client()
