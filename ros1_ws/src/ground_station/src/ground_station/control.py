"""The telepilot's control link: the heartbeat by which an autopilot detects its ground station, and the stick. Pure."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ground_station.stick import Deflection, Stick

SYSTEM, COMPONENT = 255, 190  # of a ground station, as autopilots expect it
AUTOPILOT = 1, 1
PERIOD_NS = 500_000_000
"""MAVLink's usual second is too long here: where the radio loses one packet in five, four in a row are lost now and then, and with the
fifth late an autopilot that waits for 5 s (ArduPilot's FS_GCS_TIMEOUT) takes the vehicle before the video's criteria can."""


class ControlLink:
    """Makes what is sent to the autopilot: two heartbeats a second of mission clock, and the stick while the telepilot flies."""

    def __init__(self) -> None:
        self.stick = Stick()
        self._sender = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._due_ns = 0

    def due(self, now_ns: int) -> list[bytes]:
        """Return the datagrams to send now."""
        messages: list[mavlink.MAVLink_message] = []
        if now_ns >= self._due_ns:
            self._due_ns = now_ns + PERIOD_NS
            messages.append(
                mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)
            )
        mode = self.stick.mode_to_ask(now_ns)
        if mode is not None:
            messages.append(_set_mode(mode))
        deflection = self.stick.to_send(now_ns)
        if deflection is not None:
            messages.append(_manual_control(deflection))
        return [bytes(message.pack(self._sender)) for message in messages]

    def hear(self, data: bytes) -> None:
        """Handle a datagram of the autopilot; ignore what is none of its heartbeats."""
        for message in self._parser.parse_buffer(data) or ():
            if message.get_type() == "HEARTBEAT" and (message.get_srcSystem(), message.get_srcComponent()) == AUTOPILOT:
                self.stick.hear(message.custom_mode)


def _set_mode(mode: int) -> mavlink.MAVLink_message:
    custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return mavlink.MAVLink_command_long_message(*AUTOPILOT, mavlink.MAV_CMD_DO_SET_MODE, 0, custom, mode, 0, 0, 0, 0, 0)


def _manual_control(stick: Deflection) -> mavlink.MAVLink_message:
    """Return MANUAL_CONTROL as ArduCopter reads it: x to the front, y to the right, z from 0 to 1000 with 500 to hold, r clockwise."""
    x, y, r = (round(1000.0 * axis) for axis in (stick.forward, -stick.left, -stick.turn))
    return mavlink.MAVLink_manual_control_message(AUTOPILOT[0], x, y, round(500.0 + 500.0 * stick.up), r, 0)
