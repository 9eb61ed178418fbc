"""Which heartbeats are silent. No ROS, no threads, no clock: times are seconds of any clock that only grows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

UNHEARD, HEARD, SILENT = "unheard", "heard", "silent"


@dataclass(frozen=True)
class Change:
    """A heartbeat is silent now, or is heard: for the first time, or again.

    Attributes:
        topic: whose.
        state: ``heard`` or ``silent``.
        silence_s: how long nothing was heard; 0 at the first time.
    """

    topic: str
    state: str
    silence_s: float = 0.0


@dataclass
class Heartbeats:
    """Watch over heartbeats, each from its first message on.

    A heartbeat is silent once nothing was heard of it for longer than ``silent_after_s``. Whether it was depends on when messages were
    heard, and not on how often somebody looks: a gap that has passed before anybody looked is told, too.
    """

    topics: Sequence[str]
    silent_after_s: float
    _heard_s: dict[str, float] = field(default_factory=dict)
    _silent: set[str] = field(default_factory=set)

    def hear(self, topic: str, now_s: float) -> list[Change]:
        """Record a message; return the changes, also those of other topics."""
        changes = self.look(now_s)
        last_s = self._heard_s.get(topic)
        if last_s is None or topic in self._silent:
            changes.append(Change(topic, HEARD, 0.0 if last_s is None else now_s - last_s))
        self._silent.discard(topic)
        self._heard_s[topic] = now_s
        return changes

    def look(self, now_s: float) -> list[Change]:
        """Return the heartbeats that have become silent, the longest silent first."""
        due = [(last_s, topic) for topic, last_s in self._heard_s.items() if topic not in self._silent and self._over(last_s, now_s)]
        self._silent.update(topic for _, topic in due)
        return [Change(topic, SILENT, now_s - last_s) for last_s, topic in sorted(due)]

    def wait_s(self, now_s: float) -> float | None:
        """Return for how many seconds no heartbeat can become silent; None: none has been received yet."""
        times = [last_s for topic, last_s in self._heard_s.items() if topic not in self._silent]
        return max(0.0, min(times) + self.silent_after_s - now_s) if times else None

    def states(self) -> dict[str, str]:
        """Return the state of each topic."""
        return {topic: self._state(topic) for topic in self.topics}

    @property
    def state(self) -> str:
        """Return ``silent`` if one is, ``heard`` if one was heard, else ``unheard``."""
        return SILENT if self._silent else HEARD if self._heard_s else UNHEARD

    def _state(self, topic: str) -> str:
        return SILENT if topic in self._silent else HEARD if topic in self._heard_s else UNHEARD

    def _over(self, last_s: float, now_s: float) -> bool:
        return now_s - last_s > self.silent_after_s
