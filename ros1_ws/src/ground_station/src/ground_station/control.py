"""The telepilot's control link: the heartbeat by which an autopilot knows that its ground station is there. Pure."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

SYSTEM, COMPONENT = 255, 190  # of a ground station, as autopilots expect it
PERIOD_NS = 500_000_000
"""MAVLink's usual second is too long here: where the radio loses one packet in five, four in a row are lost now and then, and with the
fifth late an autopilot that waits for 5 s (ArduPilot's FS_GCS_TIMEOUT) takes the vehicle before the video's criteria can."""


class ControlLink:
    """Makes two heartbeats a second of mission clock."""

    def __init__(self) -> None:
        self._sender = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self._due_ns = 0

    def due(self, now_ns: int) -> bytes | None:
        """Return what is to be sent now, if anything."""
        if now_ns < self._due_ns:
            return None
        self._due_ns = now_ns + PERIOD_NS
        message = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)
        return bytes(message.pack(self._sender))
