"""The MAVLink connection: a thread that reads, reconnects and never gives up, and a way to send."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_guidance.commands import Command
from uav_guidance.frames import FOLLOW_POSITION_AND_YAW, ned_from_enu, yaw_ned_from_enu
from uav_guidance.guidance import Setpoint

log = logging.getLogger(__name__)

AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT = 1, 1
COMPANION_SYSTEM, COMPANION_COMPONENT = 1, 191
READ_WAIT_S = 0.2
FIRST_RETRY_S, LONGEST_RETRY_S = 0.2, 2.0

# Nothing but heartbeats and texts comes unasked; these are asked for, by SET_MESSAGE_INTERVAL, on every link.
STREAMS_HZ: dict[int, float] = {
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 50.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 50.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 10.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 1.0,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: 0.5,
}
STREAM_PATIENCE_S = 2.5  # a stream not heard of for so long is asked for again


class LinkClosedError(ConnectionError):
    """The other side closed the connection."""


class StreamKeeper:
    """Know which streams have to be asked for: all on a new link, later those that stay away (the autopilot may have restarted)."""

    def __init__(self) -> None:
        self._heard_s: dict[int, float] = {}

    def forget(self) -> None:
        """Begin anew, on a new connection."""
        self._heard_s.clear()

    def hear(self, message_id: int, now_s: float) -> None:
        """Note that a message came."""
        if message_id in STREAMS_HZ:
            self._heard_s[message_id] = now_s

    def due(self, now_s: float) -> list[int]:
        """Return the messages to ask for now; they are not due again before their patience is over."""
        missing = [number for number in STREAMS_HZ if abs(now_s - self._heard_s.get(number, -STREAM_PATIENCE_S)) >= STREAM_PATIENCE_S]
        self._heard_s.update(dict.fromkeys(missing, now_s))
        return missing


class Link:
    """A MAVLink 2 connection to the autopilot (system and component 1/1), as its companion (1/191).

    ``on_message`` and ``on_connect`` are called in the reader's thread; ``send_...`` may be called from any thread.
    """

    def __init__(self, url: str, baud: int, *, on_message: Callable[[Any], None], on_connect: Callable[[], None]) -> None:
        self._url, self._baud = url, baud
        self._on_message, self._on_connect = on_message, on_connect
        self._ended = threading.Event()
        self._sending = threading.Lock()
        self._port: Any = None
        self._mav: Any = None
        self._thread = threading.Thread(target=self._run, name="mavlink", daemon=True)

    def start(self) -> None:
        """Begin to connect and to read."""
        self._thread.start()

    def close(self) -> None:
        """End the thread and the connection."""
        self._ended.set()
        self._thread.join(2.0 * READ_WAIT_S + 1.0)

    def send_heartbeat(self) -> None:
        """Say that the companion lives."""
        self._send(lambda mav: mav.heartbeat_encode(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4))

    def send_command(self, command: Command) -> None:
        """Send a COMMAND_LONG."""
        self._send(
            lambda mav: mav.command_long_encode(
                AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT, command.number, command.confirmation, *command.parameters
            )
        )

    def send_setpoint(self, setpoint: Setpoint) -> None:
        """Send position and yaw, relative to the EKF origin."""
        ned = ned_from_enu(setpoint.position_enu_m)
        yaw = yaw_ned_from_enu(setpoint.yaw_rad)
        self._send(
            lambda mav: mav.set_position_target_local_ned_encode(
                0,
                AUTOPILOT_SYSTEM,
                AUTOPILOT_COMPONENT,
                mavlink.MAV_FRAME_LOCAL_NED,
                FOLLOW_POSITION_AND_YAW,
                *(ned.x, ned.y, ned.z),
                *(0.0,) * 6,
                yaw,
                0.0,
            )
        )

    def ask_stream(self, message_id: int) -> None:
        """Ask for a message at its rate."""
        interval_us = 1e6 / STREAMS_HZ[message_id]
        parameters = (float(message_id), interval_us, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.send_command(Command("message interval", mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, parameters))

    def _send(self, encode: Callable[[Any], Any]) -> None:
        """Send a message, or nothing when there is no connection: what matters is repeated."""
        with self._sending:
            if self._mav is not None:
                with contextlib.suppress(OSError):
                    self._mav.send(encode(self._mav))

    def _run(self) -> None:
        retry_s = FIRST_RETRY_S
        told = ""
        while not self._ended.is_set():
            try:
                self._connect()
                retry_s, told = FIRST_RETRY_S, ""
                self._read()
            except (OSError, ValueError) as error:
                if told != str(error):
                    log.warning("autopilot at %s: %s; trying again", self._url, error)
                told = str(error)
            finally:
                self._disconnect()
            self._ended.wait(retry_s)
            retry_s = min(2.0 * retry_s, LONGEST_RETRY_S)

    def _connect(self) -> None:
        port = mavutil.mavlink_connection(self._url, baud=self._baud, retries=0)
        # pymavlink prints and goes on when a TCP peer closes; here that ends the connection.
        port.handle_eof = port.handle_disconnect = self._closed
        mav = mavlink.MAVLink(port, srcSystem=COMPANION_SYSTEM, srcComponent=COMPANION_COMPONENT)
        mav.robust_parsing = True
        with self._sending:
            self._port, self._mav = port, mav
        log.info("connected to the autopilot at %s", self._url)
        self._on_connect()

    def _disconnect(self) -> None:
        with self._sending:
            port, self._port, self._mav = self._port, None, None
        if port is not None:
            with contextlib.suppress(OSError):
                port.close()

    def _read(self) -> None:
        while not self._ended.is_set():
            if not self._port.select(READ_WAIT_S):
                continue
            data = self._port.recv(4096)
            for message in (self._mav.parse_buffer(data) if data else None) or ():
                if _from_autopilot_to_us(message):
                    self._on_message(message)

    @staticmethod
    def _closed() -> None:
        raise LinkClosedError("the connection was closed")


def _from_autopilot_to_us(message: Any) -> bool:
    """Tell the autopilot's own messages from those that it forwards, and our answers from other clients'."""
    if (message.get_srcSystem(), message.get_srcComponent()) != (AUTOPILOT_SYSTEM, AUTOPILOT_COMPONENT):
        return False
    if message.get_type() != "COMMAND_ACK":
        return True
    return message.target_system in {0, COMPANION_SYSTEM} and message.target_component in {0, COMPANION_COMPONENT}
