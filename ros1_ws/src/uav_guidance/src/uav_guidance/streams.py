"""Which messages the autopilot has to send: only heartbeats and texts come without a request."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

STREAMS_HZ: dict[int, float] = {
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 50.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 50.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 10.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 5.0,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 5.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 1.0,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: 0.5,
}
TIMEOUT_S = 2.5


class StreamKeeper:
    """Keeps the requests for streams: all on a new link, later those that stay away (the autopilot may have restarted)."""

    def __init__(self) -> None:
        self._heard_s: dict[int, float] = {}

    def forget(self) -> None:
        """Begin again, on a new connection."""
        self._heard_s.clear()

    def hear(self, message_id: int, now_s: float) -> None:
        """Record that a message came, at this time of the mission clock."""
        if message_id in STREAMS_HZ:
            self._heard_s[message_id] = now_s

    def due(self, now_s: float) -> list[int]:
        """Return the messages to request now; they are not due again before 2.5 s are over."""
        missing = [number for number in STREAMS_HZ if number not in self._heard_s or abs(now_s - self._heard_s[number]) >= TIMEOUT_S]
        self._heard_s.update(dict.fromkeys(missing, now_s))
        return missing
