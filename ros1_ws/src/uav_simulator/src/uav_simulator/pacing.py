"""Lockstep: whether simulated time may go on, given how far those who work for it have come. No ROS, no clock of its own."""

from __future__ import annotations

import struct
import threading
from dataclasses import dataclass

ROUNDING_S = 1e-6  # of stamps in floating point


@dataclass
class _Listener:
    stamp_s: float
    live: bool = True
    lagging_since_s: float | None = None  # wall


class Pacer:
    """Remembers the last stamp of each topic; heard from other threads than the one that asks."""

    def __init__(self, *, limit_s: float, patience_s: float) -> None:
        self._limit_s, self._patience_s = limit_s, patience_s
        self._listeners: dict[str, _Listener] = {}
        self._lock = threading.Lock()

    def heard(self, topic: str, stamp_s: float) -> None:
        """Note a message; one that has been left out is back when it speaks with a newer stamp."""
        if stamp_s <= 0.0:
            return
        with self._lock:
            listener = self._listeners.setdefault(topic, _Listener(stamp_s))
            if stamp_s > listener.stamp_s:
                self._listeners[topic] = _Listener(stamp_s, lagging_since_s=listener.lagging_since_s if listener.live else None)

    def may_advance(self, now_s: float, wall_s: float) -> bool:
        """Return whether simulated time may go on at ``now_s``; ``wall_s`` is a monotonic clock for the patience."""
        with self._lock:
            held = [self._holds(listener, now_s, wall_s) for listener in self._listeners.values()]  # asks everyone, for their patience
            return not any(held)

    @property
    def left_out(self) -> list[str]:
        """Return the topics that are not waited for any more."""
        with self._lock:
            return sorted(topic for topic, listener in self._listeners.items() if not listener.live)

    def _holds(self, listener: _Listener, now_s: float, wall_s: float) -> bool:
        if not listener.live:
            return False
        if now_s - listener.stamp_s <= self._limit_s + ROUNDING_S:
            listener.lagging_since_s = None
            return False
        if listener.lagging_since_s is None:
            listener.lagging_since_s = wall_s
        listener.live = wall_s - listener.lagging_since_s < self._patience_s
        return listener.live


def header_stamp_s(message: bytes) -> float:
    """Return the stamp of a serialised ROS 1 message that begins with a std_msgs/Header (uint32 seq, uint32 secs, uint32 nsecs)."""
    _, secs, nsecs = struct.unpack_from("<III", message)
    return float(secs) + float(nsecs) * 1e-9
