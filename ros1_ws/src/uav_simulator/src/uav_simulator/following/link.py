"""A MAVLink connection that listens to an autopilot beside the guidance's own: it requests streams, and commands nothing."""

from __future__ import annotations

import contextlib
import logging
import time
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

AUTOPILOT = (1, 1)
SYSTEM, COMPONENT = 1, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER2
STREAMS_HZ = {
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 50.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 50.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
}
HEARTBEAT_S, ASK_S, RETRY_S = 1.0, 2.5, 1.0  # wall clock
BUFFER = 4096

log = logging.getLogger(__name__)


class ListeningLink:
    """Reads in the caller's thread, reconnects by itself, and requests again streams that stay away (the autopilot restarted)."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._port: Any = None
        self._mav: Any = None
        self._retry_s = self._heartbeat_s = 0.0
        self._heard_s = dict.fromkeys(STREAMS_HZ, 0.0)
        self._told = ""

    def read(self, wait_s: float) -> list[Any]:
        """Return the autopilot's messages that have come, or come first within ``wait_s`` of wall clock."""
        try:
            return self._read(wait_s)
        except (OSError, ValueError) as error:
            if str(error) != self._told:
                log.warning("autopilot at %s: %s; trying again", self._url, error)
            self._told = str(error)
            self.close()
            self._retry_s = time.monotonic() + RETRY_S
            return []

    def close(self) -> None:
        """Close the MAVLink connection, if one is open."""
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(OSError):
                port.close()

    def _read(self, wait_s: float) -> list[Any]:
        if self._port is None:
            if time.monotonic() < self._retry_s:
                time.sleep(wait_s)
                return []
            self._connect()
        self._speak()
        if not self._port.select(wait_s):
            return []
        data = self._port.recv(BUFFER)
        parsed = (self._mav.parse_buffer(data) if data else None) or ()
        messages = [m for m in parsed if (m.get_srcSystem(), m.get_srcComponent()) == AUTOPILOT]
        self._heard_s.update({m.get_msgId(): time.monotonic() for m in messages if m.get_msgId() in STREAMS_HZ})
        return messages

    def _connect(self) -> None:
        self._port = mavutil.mavlink_connection(self._url, retries=0)
        # pymavlink prints and goes on when a TCP peer closes; here that ends the connection.
        self._port.handle_eof = self._port.handle_disconnect = self._closed
        self._mav = mavlink.MAVLink(self._port, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self._mav.robust_parsing = True
        self._heartbeat_s = 0.0
        self._heard_s = dict.fromkeys(STREAMS_HZ, 0.0)
        log.info("the sensors follow the autopilot at %s", self._url)

    def _speak(self) -> None:
        now_s = time.monotonic()
        if now_s - self._heartbeat_s >= HEARTBEAT_S:
            self._heartbeat_s = now_s
            kind, no_autopilot = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID
            self._mav.send(mavlink.MAVLink_heartbeat_message(kind, no_autopilot, 0, 0, mavlink.MAV_STATE_ACTIVE, 3))
        for number, rate_hz in STREAMS_HZ.items():
            if now_s - self._heard_s[number] >= ASK_S:
                self._heard_s[number] = now_s
                asked = (float(number), 1e6 / rate_hz, 0.0, 0.0, 0.0, 0.0, 0.0)
                self._mav.send(mavlink.MAVLink_command_long_message(*AUTOPILOT, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, *asked))

    @staticmethod
    def _closed() -> None:
        raise ConnectionError("the connection was closed")
