"""Lockstep: whether simulated time may go on, given how far the nodes that it waits for have come. No ROS, no clock of its own."""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterable
from dataclasses import dataclass

ROUNDING_S = 1e-6
LIMIT_S = 0.1  # a node may be behind the clock by two steps
LEAST_SHARE, SHARE_STEPS = 0.02, 20.0  # steps over which a share is averaged


@dataclass
class _Follower:
    limit_s: float
    stamp_s: float | None = None  # of the last message; None: time does not wait for it
    lagging_since_s: float | None = None  # of what is waited by


class Lockstep:
    """Each topic carries a std_msgs/Header; heard from other threads than the one that asks."""

    def __init__(self, topics: Iterable[str], timeout_s: float) -> None:
        """``topics``: each alone, or with the seconds that it may lag, as in ``/mission/heartbeat=0.3``."""
        words = [topic.partition("=") for topic in topics]
        self._followers = {topic: _Follower(float(limit) if limit else LIMIT_S) for topic, _, limit in words}
        self._timeout_s = timeout_s
        self._lock = threading.Lock()

    @property
    def topics(self) -> list[str]:
        """The topics that time waits for."""
        return list(self._followers)

    @property
    def left_out(self) -> list[str]:
        """Topics that time does not wait for: their nodes died, hang, or were never there."""
        with self._lock:
            return [topic for topic, follower in self._followers.items() if follower.stamp_s is None]

    def heard(self, topic: str, stamp_s: float) -> None:
        """Note how far a node has come."""
        with self._lock:
            follower = self._followers[topic]
            follower.stamp_s, follower.lagging_since_s = stamp_s, None

    def gone(self, topic: str) -> None:
        """Note that nothing publishes a topic any more: time goes on without it until it is heard again."""
        with self._lock:
            self._followers[topic].stamp_s = None

    def lagging(self, now_s: float, waited_s: float) -> list[str]:
        """Return the topics that are behind ``now_s``; one is not waited for any more after the timeout, by ``waited_s``, which only grows."""
        with self._lock:
            return [topic for topic, follower in self._followers.items() if self._lags(follower, now_s, waited_s)]

    def _lags(self, follower: _Follower, now_s: float, waited_s: float) -> bool:
        if follower.stamp_s is None or now_s - follower.stamp_s <= follower.limit_s + ROUNDING_S:
            return False
        follower.lagging_since_s = waited_s if follower.lagging_since_s is None else follower.lagging_since_s
        if waited_s - follower.lagging_since_s >= self._timeout_s:
            follower.stamp_s = None
            return False
        return True


class ProcessorShare:
    """Which part of a processor this process gets while it works: 1 on a machine that does nothing else, less on a busy one.

    A process that is started again gets about the same part. So time that goes on meanwhile, that much slower, gives it as long as it
    takes on a machine of its own.
    """

    def __init__(self) -> None:
        self.share = 1.0

    def worked(self, wall_s: float, processor_s: float) -> None:
        """Note how long a step took, and how much of that it was computed."""
        if wall_s > 0.0:
            measured = min(max(processor_s / wall_s, LEAST_SHARE), 1.0)
            self.share += (measured - self.share) / SHARE_STEPS


def stamp_s(header: bytes) -> float:
    """Return the stamp of a serialised std_msgs/Header (uint32 seq, secs, nsecs)."""
    _, secs, nsecs = struct.unpack_from("<III", header)
    return float(secs) + float(nsecs) * 1e-9
