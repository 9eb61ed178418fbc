"""For those who depend on the other world: tell within half a second that it is gone, from the bridge's heartbeat. No ROS in here.

In ROS 2, with a node of one's own::

    watch = BridgeWatch()
    node.create_subscription(String, STATE_TOPIC, lambda message: watch.hear(message.data, time.monotonic()), LATCHED)
    node.create_timer(0.1, lambda: print(watch.look(time.monotonic())))
"""

from __future__ import annotations

import json
from enum import Enum

LIMIT_S = 0.5


class OtherWorld(Enum):
    """What is known of the way to the other world."""

    REACHABLE = "reachable"
    NO_BRIDGE = "no bridge"  # none has been heard, it has ended, or its heartbeat has stopped
    NO_ROS1_MASTER = "no ROS 1 master"  # connections may go on, nothing new can be found


class BridgeWatch:
    """The last heartbeat and its age. Times are a steady clock's, in seconds."""

    def __init__(self, limit_s: float = LIMIT_S) -> None:
        """Begin without a bridge; ``limit_s`` is how old a heartbeat may be."""
        self._limit_s = limit_s
        self._heard_s: float | None = None
        self._running = False
        self._master = False
        self._sequence = 0

    def hear(self, text: str, now_s: float) -> None:
        """Take a heartbeat; what is none is ignored."""
        try:
            state = json.loads(text)
            running, master = state["state"] == "running", bool(state["ros1_master"])
            sequence = int(state["sequence"])
        except (ValueError, TypeError, KeyError):
            return
        latched_again = self._heard_s is not None and sequence == self._sequence
        self._running, self._master, self._sequence = running, master, sequence
        if not latched_again:
            self._heard_s = now_s

    def look(self, now_s: float) -> OtherWorld:
        """Return what is known now."""
        if self._heard_s is None or not self._running or now_s - self._heard_s > self._limit_s:
            return OtherWorld.NO_BRIDGE
        return OtherWorld.REACHABLE if self._master else OtherWorld.NO_ROS1_MASTER
