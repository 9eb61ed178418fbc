"""Lockstep: whether simulated time may go on, given how far the nodes that it waits for have come. No ROS, no clock of its own.

A topic is held against the simulated clock, or, written ``TOPIC=SENSOR``, against the last measurement that the sensor published: a
node that works on images has done its share when the last image is dealt with, and need not say anything while there are none. It has
nearly the sensor's period for that, as on a machine that is fast enough: so its verdicts come as regularly as the measurements.
``TOPIC=0.06`` sets the seconds by which a topic may lag behind the clock; ``TOPIC=inf`` is waited for at the beginning only.

A node that is done with its measurements may know an old time all the same: the clock comes over another connection than the images, and
on a busy machine later. It would take measurements of now for such of the future, and miss them when its clock catches up. So its
health, which has its own time, is waited for, too.
"""

from __future__ import annotations

import struct
import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

ROUNDING_S = 1e-6  # of stamps in floating point
WORK_S = 0.07  # at 10 Hz and ticks of 20 ms: a measurement is dealt with before the next one is made
MEASUREMENTS = 64  # of each sensor that are remembered


@dataclass
class _Listener:
    stamp_s: float
    live: bool = True
    lagging_since_s: float | None = None  # wall


class Pacer:
    """Remembers the last stamp of each topic; heard from other threads than the one that asks."""

    def __init__(self, topics: Iterable[str] = (), *, limit_s: float, timeout_s: float) -> None:
        self._limit_s, self._timeout_s = limit_s, timeout_s
        words = [word.partition("=") for word in topics]
        said = {topic: against for topic, _, against in words if against}
        self._limits_s = {topic: float(against) for topic, against in said.items() if against[0].isdigit() or against == "inf"}
        self._sensor_of = {topic: against for topic, against in said.items() if topic not in self._limits_s}
        self._topics = [topic for topic, _, _ in words]
        self._measured: dict[str, deque[tuple[float, float]]] = {}  # of each sensor: stamps, and when they were published
        self._listeners: dict[str, _Listener] = {}
        self._lock = threading.Lock()

    def begin(self, now_s: float) -> None:
        """Record that simulated time begins: from now on no topic may lag behind the clock, or its sensor, received or not."""
        with self._lock:
            for topic in self._topics:
                self._listeners.setdefault(topic, _Listener(now_s))

    def measured(self, sensor: str, stamp_s: float, now_s: float) -> None:
        """Record that a sensor has published a measurement just now."""
        with self._lock:
            self._measured.setdefault(sensor, deque(maxlen=MEASUREMENTS)).append((stamp_s, now_s))

    def heard(self, topic: str, stamp_s: float) -> None:
        """Record a message; a topic that was left out is back with a newer stamp.

        One that says again how far it has come does not hang: it waits for something itself, as a mission for another robot.
        """
        if stamp_s <= 0.0:
            return
        with self._lock:
            listener = self._listeners.setdefault(topic, _Listener(stamp_s))
            if stamp_s > listener.stamp_s:
                self._listeners[topic] = _Listener(stamp_s, lagging_since_s=listener.lagging_since_s if listener.live else None)
            elif stamp_s == listener.stamp_s:
                listener.lagging_since_s = None

    def may_advance(self, now_s: float, wall_s: float) -> bool:
        """Return whether simulated time may go on at ``now_s``; ``wall_s`` is a monotonic clock for the timeout."""
        with self._lock:
            # Asks every topic: each has a timeout of its own.
            held = [self._holds(listener, self._lag_s(topic, listener, now_s), wall_s) for topic, listener in self._listeners.items()]
            return not any(held)

    def gone(self, topic: str) -> None:
        """Record that nothing publishes the topic any more: it is not waited for until its next message."""
        with self._lock:
            if topic in self._listeners:
                self._listeners[topic].live = False

    @property
    def left_out(self) -> list[str]:
        """Return the topics that are not waited for any more."""
        with self._lock:
            return sorted(topic for topic, listener in self._listeners.items() if not listener.live)

    def _lag_s(self, topic: str, listener: _Listener, now_s: float) -> float:
        """Return by how much the topic lags more than it may; not positive: it does not."""
        sensor = self._sensor_of.get(topic)
        if sensor is None:
            return now_s - listener.stamp_s - self._limits_s.get(topic, self._limit_s)
        measured = self._measured.get(sensor, ())
        waiting = next((published_s for stamp_s, published_s in measured if stamp_s > listener.stamp_s + ROUNDING_S), None)
        return -WORK_S if waiting is None else now_s - waiting - WORK_S

    def _holds(self, listener: _Listener, lag_s: float, wall_s: float) -> bool:
        if not listener.live:
            return False
        if lag_s <= ROUNDING_S:
            listener.lagging_since_s = None
            return False
        if listener.lagging_since_s is None:
            listener.lagging_since_s = wall_s
        listener.live = wall_s - listener.lagging_since_s < self._timeout_s
        return listener.live


def header_stamp_s(message: bytes) -> float:
    """Return the stamp of a serialised ROS 1 message that begins with a std_msgs/Header (uint32 seq, uint32 secs, uint32 nsecs)."""
    _, secs, nsecs = struct.unpack_from("<III", message)
    return float(secs) + float(nsecs) * 1e-9
