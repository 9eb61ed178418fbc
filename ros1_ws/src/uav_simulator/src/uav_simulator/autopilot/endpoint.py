"""The MAVLink side of the autopilot: bytes in, bytes out; an endpoint knows one link and nothing of sockets.

Packing and parsing are pymavlink's, dialect ardupilotmega, MAVLink 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_simulator.autopilot import telemetry
from uav_simulator.autopilot.core import FORCE_MAGIC, Autopilot
from uav_simulator.autopilot.setpoint import BODY_NED, BODY_OFFSET_NED, RawSetpoint
from uav_simulator.autopilot.sticks import Deflection
from uav_simulator.autopilot.streams import Streams
from uav_simulator.autopilot.types import Mode, Notice, Result
from uav_simulator.frames import enu_from_ned, frd_from_flu, yaw_enu_from_ned

SYSTEM, COMPONENT = 1, 1  # of the autopilot
GCS_SYSTEM, GCS_COMPONENT = 255, 190
TIMESYNC_PERIOD_S = 10.0
NO_AXIS = 0x7FFF  # of MANUAL_CONTROL: there is no such stick
SPEED_AXES = {0: "horizontal", 1: "horizontal", 2: "up", 3: "down"}
Message = Any  # pymavlink's messages have no types


class Endpoint:
    """One link: parses messages, acknowledges, streams what was requested.

    Texts and notices go to every link of the autopilot, and the heartbeats of one are forwarded to the others, as ArduPilot does.
    Where no other link is open for a ground station (``connect``), one is part of the picture: its heartbeats come to this link, so
    that a client which does not filter on system and component is found out.
    """

    def __init__(self, pilot: Autopilot, *, gcs_present: bool = True) -> None:
        """``gcs_present``: a ground station is part of the picture."""
        self._pilot = pilot
        self.gcs_present = gcs_present
        self._others: list[Endpoint] = []
        self._gcs_due_s = 0.0
        self._timesync_due_s = 0.0
        self._out = bytearray()
        self._sender = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self._gcs = mavlink.MAVLink(None, srcSystem=GCS_SYSTEM, srcComponent=GCS_COMPONENT)
        self._parser = mavlink.MAVLink(None)
        self._streams = Streams()
        self.open_link()
        self._messages: dict[str, Callable[[Message], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "COMMAND_LONG": self._on_command_long,
            "COMMAND_INT": self._on_command_int,
            "SET_MODE": self._on_set_mode,
            "SET_POSITION_TARGET_LOCAL_NED": self._on_setpoint,
            "REQUEST_DATA_STREAM": self._on_request_data_stream,
            "MANUAL_CONTROL": self._on_manual_control,
            "PARAM_REQUEST_READ": self._on_param_read,
            "PARAM_REQUEST_LIST": self._on_param_list,
            "PARAM_SET": self._on_param_set,
            "TIMESYNC": self._on_timesync,
        }
        self._commands: dict[int, Callable[[list[float]], Result]] = {
            mavlink.MAV_CMD_NAV_LAND: lambda _: pilot.set_mode(Mode.LAND),
            mavlink.MAV_CMD_NAV_TAKEOFF: lambda p: pilot.take_off(p[6]),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: pilot.set_mode(Mode.RTL),
            mavlink.MAV_CMD_CONDITION_YAW: self._condition_yaw,
            mavlink.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._do_change_speed,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_GET_HOME_POSITION: lambda _: self._send_once(mavlink.MAVLINK_MSG_ID_HOME_POSITION),
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_message_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: lambda p: self._send_once(round(p[0])),
        }

    def connect(self, other: Endpoint) -> None:
        """Share the autopilot with another link."""
        self._others.append(other)
        other._others.append(self)

    def open_link(self) -> None:
        """Begin with a fresh link: no requests, no pending bytes."""
        self._streams = Streams()
        self._out.clear()
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True

    def feed(self, data: bytes) -> None:
        """Handle received bytes; answers wait in ``take_output``."""
        for message in self._parser.parse_buffer(data) or []:
            handler = self._messages.get(message.get_type())
            if handler and getattr(message, "target_system", SYSTEM) in {0, SYSTEM}:
                handler(message)
        self._tell()

    def step(self) -> None:
        """Send the messages that are due now; call after the autopilot's step."""
        pilot = self._pilot
        if self.gcs_present and pilot.now_s >= self._gcs_due_s:
            self._gcs_due_s = pilot.now_s + 1.0
            self._hear_gcs(GCS_SYSTEM)
            gcs = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)
            self._out += gcs.pack(self._gcs)
        self._tell()
        for message_id in self._streams.due(pilot.now_s):
            self._send(telemetry.BUILDERS[message_id](pilot))
        if pilot.now_s >= self._timesync_due_s:
            self._timesync_due_s = pilot.now_s + TIMESYNC_PERIOD_S
            self._send(mavlink.MAVLink_timesync_message(0, round(pilot.boot_s * 1e9)))

    def take_output(self) -> bytes:
        """Return the bytes to send, and clear them."""
        data = bytes(self._out)
        self._out.clear()
        return data

    def _send(self, message: Message | None) -> None:
        if message is not None:
            self._out += message.pack(self._sender)

    def _tell(self) -> None:
        """Send texts and what changed."""
        builders = {Notice.HEARTBEAT: telemetry.heartbeat, Notice.HOME: telemetry.home_position, Notice.ORIGIN: telemetry.gps_global_origin}
        messages = [mavlink.MAVLink_statustext_message(int(text.severity), text.text[:50].encode()) for text in self._pilot.take_texts()]
        messages += [builders[notice](self._pilot) for notice in dict.fromkeys(self._pilot.take_notices())]
        for message in messages:
            for endpoint in (self, *self._others):
                endpoint._send(message)  # noqa: SLF001 - one class

    def _send_once(self, message_id: int) -> Result:
        builder = telemetry.BUILDERS.get(message_id)
        message = builder(self._pilot) if builder else None
        self._send(message)
        return Result.FAILED if message is None else Result.ACCEPTED

    # --- messages ----------------------------------------------------------------------------------------------------

    def _hear_gcs(self, system: int) -> None:
        if system == round(self._pilot.params["SYSID_MYGCS"]):
            self._pilot.hear_gcs()

    def _on_heartbeat(self, message: Message) -> None:
        self._hear_gcs(message.get_srcSystem())
        for endpoint in self._others:
            endpoint._out += message.get_msgbuf()  # noqa: SLF001 - one class

    def _on_command_long(self, message: Message) -> None:
        params = [message.param1, message.param2, message.param3, message.param4, message.param5, message.param6, message.param7]
        self._command(message, params)

    def _on_command_int(self, message: Message) -> None:
        params = [message.param1, message.param2, message.param3, message.param4, float(message.x), float(message.y), message.z]
        self._command(message, params)

    def _command(self, message: Message, params: list[float]) -> None:
        if message.target_component not in {0, COMPONENT}:
            return
        handler = self._commands.get(message.command)
        result = handler(params) if handler else Result.UNSUPPORTED
        self._tell()
        sender = (message.get_srcSystem(), message.get_srcComponent())
        self._send(mavlink.MAVLink_command_ack_message(message.command, int(result), 0, 0, *sender))

    def _on_set_mode(self, message: Message) -> None:
        if message.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            self._pilot.set_mode(message.custom_mode)

    def _on_setpoint(self, message: Message) -> None:
        body = message.coordinate_frame in {BODY_NED, BODY_OFFSET_NED}
        turn = frd_from_flu if body else enu_from_ned
        self._pilot.setpoint(
            RawSetpoint(
                frame=message.coordinate_frame,
                type_mask=message.type_mask,
                position=turn((message.x, message.y, message.z)),
                velocity=turn((message.vx, message.vy, message.vz)),
                yaw_rad=yaw_enu_from_ned(message.yaw),
                yaw_rate_rad_s=-message.yaw_rate,
            )
        )

    def _on_manual_control(self, message: Message) -> None:
        """Take the sticks of the ground station that SYSID_MYGCS names; like a heartbeat, they say that it is there."""
        system = message.get_srcSystem()
        if message.target != SYSTEM or system != round(self._pilot.params["SYSID_MYGCS"]):
            return
        self._hear_gcs(system)
        forward, right, clockwise = (0.0 if axis == NO_AXIS else axis / 1000.0 for axis in (message.x, message.y, message.r))
        up = 0.0 if message.z == NO_AXIS else message.z / 500.0 - 1.0
        self._pilot.manual_control(Deflection(forward, -right, up, -clockwise))

    def _on_request_data_stream(self, message: Message) -> None:
        start = bool(message.start_stop)
        self._streams.request_group(message.req_stream_id, message.req_message_rate, start=start, now_s=self._pilot.now_s)

    def _on_timesync(self, message: Message) -> None:
        if message.tc1 == 0:
            self._send(mavlink.MAVLink_timesync_message(round(self._pilot.boot_s * 1e9), message.ts1))

    def _send_param(self, name: str) -> None:
        params = self._pilot.params
        index, count = params.names.index(name), len(params.names)
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        self._send(mavlink.MAVLink_param_value_message(name.encode(), params[name], kind, count, index))

    def _on_param_read(self, message: Message) -> None:
        names = self._pilot.params.names
        name = message.param_id if message.param_index < 0 else dict(enumerate(names)).get(message.param_index, "")
        if name in self._pilot.params:
            self._send_param(name)

    def _on_param_list(self, _: Message) -> None:
        for name in self._pilot.params.names:
            self._send_param(name)

    def _on_param_set(self, message: Message) -> None:
        if message.param_id in self._pilot.params and math.isfinite(message.param_value):
            self._pilot.params.set(message.param_id, message.param_value)
            self._send_param(message.param_id)

    # --- commands ----------------------------------------------------------------------------------------------------

    def _do_set_mode(self, params: list[float]) -> Result:
        if not round(params[0]) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return Result.DENIED
        return self._pilot.set_mode(round(params[1]))

    def _arm_disarm(self, params: list[float]) -> Result:
        force = params[1] == FORCE_MAGIC
        if params[0] == 1.0:
            return self._pilot.arm(force=force)
        if params[0] == 0.0:
            return self._pilot.disarm(force=force)
        return Result.UNSUPPORTED

    def _condition_yaw(self, params: list[float]) -> Result:
        angle_deg, speed_deg_s, direction, relative = params[:4]
        if not 0.0 <= angle_deg <= 360.0 or relative not in {0.0, 1.0}:
            return Result.FAILED
        clockwise = 0 if direction == 0.0 else int(math.copysign(1, direction))
        angle_rad = math.radians(angle_deg)
        yaw_rad = -angle_rad * (clockwise or 1) if relative else yaw_enu_from_ned(angle_rad)
        speed = math.radians(speed_deg_s) if speed_deg_s > 0.0 else 0.0
        return self._pilot.condition_yaw(yaw_rad, relative=bool(relative), turn=-clockwise, speed_rad_s=speed)

    def _do_change_speed(self, params: list[float]) -> Result:
        axis = SPEED_AXES.get(round(params[0]))
        return self._pilot.change_speed(axis, params[1]) if axis else Result.DENIED

    def _set_message_interval(self, params: list[float]) -> Result:
        message_id = round(params[0])
        if message_id not in telemetry.BUILDERS:
            return Result.DENIED
        self._streams.set_interval(message_id, params[1], self._pilot.now_s)
        return Result.ACCEPTED

    def _get_message_interval(self, params: list[float]) -> Result:
        message_id = round(params[0])
        if message_id not in telemetry.BUILDERS:
            return Result.FAILED
        self._send(mavlink.MAVLink_message_interval_message(message_id, self._streams.interval_us(message_id)))
        return Result.ACCEPTED
