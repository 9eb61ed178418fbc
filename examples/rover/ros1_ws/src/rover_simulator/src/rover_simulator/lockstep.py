"""Lockstep: whether simulated time may go on, given how far the nodes that it waits for have come. No ROS, no clock of its own.

A node that has taken all odometry may not have taken the scans of that time: they come over another connection, and on a busy machine
later. Who judges by the clock whether scans still come is therefore also held against the scans that were published.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterable
from dataclasses import dataclass

ROUNDING_S = 1e-6
LIMIT_S = 0.1  # a node may be behind the clock by two steps
SCANS = "scans"
LEAST_SHARE, SHARE_STEPS = 0.02, 20.0  # steps over which a share is averaged


@dataclass
class _Follower:
    limit_s: float
    scans: bool  # held against the scans: it has taken all but the last
    stamp_s: float | None = None  # of the last message; None: time does not wait for it
    lagging_since_s: float | None = None  # of what is waited by


class Lockstep:
    """Each topic carries a std_msgs/Header; heard from other threads than the one that asks."""

    def __init__(self, topics: Iterable[str], timeout_s: float) -> None:
        """``topics``: each alone, with the seconds that it may lag, as in ``/mission/heartbeat=0.3``, or ``/health/scans=scans``."""
        words = [topic.partition("=") for topic in topics]
        said = {topic: against for topic, _, against in words}
        self._followers = {
            topic: _Follower(float(against) if against not in {"", SCANS} else LIMIT_S, against == SCANS) for topic, against in said.items()
        }
        self._scans_s: tuple[float, float] | None = None  # stamps of the last scan but one, and of the last
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

    def scanned(self, stamp_s: float) -> None:
        """Note that a scan is published."""
        with self._lock:
            self._scans_s = (stamp_s if self._scans_s is None else self._scans_s[1], stamp_s)

    def gone(self, topic: str) -> None:
        """Note that nothing publishes a topic any more: time goes on without it until it is heard again."""
        with self._lock:
            self._followers[topic].stamp_s = None

    def lagging(self, now_s: float, waited_s: float) -> list[str]:
        """Return the topics that are behind ``now_s``; one is not waited for any more after the timeout, by ``waited_s``, which only grows."""
        with self._lock:
            return [topic for topic, follower in self._followers.items() if self._lags(follower, now_s, waited_s)]

    def _lags(self, follower: _Follower, now_s: float, waited_s: float) -> bool:
        if follower.stamp_s is None or self._behind_s(follower.stamp_s, follower, now_s) <= ROUNDING_S:
            return False
        follower.lagging_since_s = waited_s if follower.lagging_since_s is None else follower.lagging_since_s
        if waited_s - follower.lagging_since_s >= self._timeout_s:
            follower.stamp_s = None
            return False
        return True

    def _behind_s(self, stamp_s: float, follower: _Follower, now_s: float) -> float:
        if not follower.scans:
            return now_s - stamp_s - follower.limit_s
        return 0.0 if self._scans_s is None else self._scans_s[0] - stamp_s


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
