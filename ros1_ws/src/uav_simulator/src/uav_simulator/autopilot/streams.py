"""Which messages a link has requested, and when each is due."""

from __future__ import annotations

from dataclasses import dataclass

HEARTBEAT_ID = 0
# MAV_DATA_STREAM to the messages that it brings; EXTENDED_SYS_STATE, HOME_POSITION and POSITION_TARGET_LOCAL_NED are in none.
DATA_STREAMS: dict[int, tuple[int, ...]] = {
    2: (1, 24),  # EXTENDED_STATUS: SYS_STATUS, GPS_RAW_INT
    6: (32, 33),  # POSITION: LOCAL_POSITION_NED, GLOBAL_POSITION_INT
    10: (30,),  # EXTRA1: ATTITUDE
    12: (2, 147, 193),  # EXTRA3: SYSTEM_TIME, BATTERY_STATUS, EKF_STATUS_REPORT
}
ALL_STREAMS = 0


@dataclass
class _Stream:
    interval_s: float
    due_s: float
    individual: bool


class Streams:
    """The streams of one link; a fresh link has only the heartbeat."""

    def __init__(self) -> None:
        self._streams = {HEARTBEAT_ID: _Stream(1.0, 0.0, individual=False)}

    def set_interval(self, message_id: int, interval_us: float, now_s: float) -> None:
        """Set the interval of one message: microseconds between two, 0 or less for none."""
        if interval_us > 0.0:
            self._streams[message_id] = _Stream(interval_us * 1e-6, now_s, individual=True)
        else:
            self._streams.pop(message_id, None)

    def interval_us(self, message_id: int) -> int:
        """Return the interval in microseconds, -1 when the message is not sent."""
        stream = self._streams.get(message_id)
        return round(stream.interval_s * 1e6) if stream else -1

    def request_group(self, group: int, rate_hz: int, *, start: bool, now_s: float) -> None:
        """Serve REQUEST_DATA_STREAM, which also clears the requests for single messages."""
        self._streams = {k: s for k, s in self._streams.items() if not s.individual}
        groups = DATA_STREAMS.values() if group == ALL_STREAMS else [DATA_STREAMS.get(group, ())]
        for message_id in (i for ids in groups for i in ids):
            if start and rate_hz > 0:
                self._streams[message_id] = _Stream(1.0 / rate_hz, now_s, individual=False)
            else:
                self._streams.pop(message_id, None)

    def due(self, now_s: float) -> list[int]:
        """Return the messages to send now; a late one is not made up for."""
        due = []
        for message_id, stream in self._streams.items():
            if now_s >= stream.due_s - 1e-6:
                due.append(message_id)
                stream.due_s = max(stream.due_s + stream.interval_s, now_s + 1e-6)
        return due
