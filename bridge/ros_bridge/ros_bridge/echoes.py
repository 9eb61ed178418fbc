"""Recognise our own ROS 2 publications where rclpy can't keep them from our own subscription to the same topic.

Each message that goes out is remembered by its bytes until the same bytes come in once. A foreign message of the same bytes may be taken
for ours, but then ours is taken for the foreign one: what gets through is the same either way.
"""

from __future__ import annotations

import threading
import time
from collections import deque

FORGET_AFTER_S = 2.0  # a message that a full queue has dropped never comes back


class Echoes:
    """What is on its way back, by topic; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._listening: dict[str, deque[tuple[float, bytes]]] = {}

    def listen(self, topic: str) -> None:
        """Begin to remember what is sent to a topic: there is a subscription now that it returns to."""
        with self._lock:
            self._listening[topic] = deque()

    def forget(self, topic: str) -> None:
        """End it."""
        with self._lock:
            self._listening.pop(topic, None)

    def sent(self, topic: str, cdr: bytes) -> None:
        """Remember a message that is about to be published."""
        with self._lock:
            if (pending := self._listening.get(topic)) is not None:
                pending.append((time.monotonic() + FORGET_AFTER_S, cdr))

    def returned(self, topic: str, cdr: bytes) -> bool:
        """Tell whether a message that came in is one of ours; each is recognised once."""
        with self._lock:
            pending = self._listening.get(topic, deque())
            while pending and pending[0][0] < time.monotonic():
                pending.popleft()
            ours = next((entry for entry in pending if entry[1] == cdr), None)
            if ours is not None:
                pending.remove(ours)
            return ours is not None


ECHOES = Echoes()  # of this process: its ends are one participant of ROS 2
