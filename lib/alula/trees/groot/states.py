"""What viewers may see of a tree that is being ticked: stored by the mission, read by the thread that serves."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock

from alula.trees.groot.protocol import IDLE_FROM, Change, Status, Transition, pack_status, pack_transitions

KEPT_TRANSITIONS = 1000
"""Of a recording that nobody fetches, the newest; as many as BehaviorTree.CPP keeps."""

Values = Callable[[], Mapping[str, object]]


class NodeStates:
    """The status of each node, and transitions while a viewer has them recorded.

    ``uids``: of all nodes, in the order in which viewers get them. ``clock_us``: mission clock, microseconds; of any thread.
    The lock is held for a store or a copy, never while anything is sent.
    """

    def __init__(self, uids: Iterable[int], clock_us: Callable[[], int]) -> None:
        self._lock = Lock()
        self._clock_us = clock_us
        self._codes = bytearray()
        self._places: dict[int, int] = {}
        for uid in uids:
            self._codes += pack_status(uid, Status.IDLE)
            self._places[uid] = len(self._codes) - 1
        self._recording = False
        self._began_us = 0
        self._transitions: deque[bytes] = deque(maxlen=KEPT_TRANSITIONS)

    def take(self, changes: Sequence[Change], now_us: int) -> None:
        """Take what has changed in a tick, in the order of the changes; called by the mission."""
        with self._lock:
            codes, places = self._codes, self._places
            for uid, previous, status in changes:
                codes[places[uid]] = status or IDLE_FROM + previous
            if self._recording:
                packed = pack_transitions(changes, now_us - self._began_us)
                self._transitions.extend(packed[at : at + Transition.SIZE] for at in range(0, len(packed), Transition.SIZE))

    def codes(self) -> bytes:
        """Return the reply to STATUS: three bytes a node."""
        with self._lock:
            return bytes(self._codes)

    def start(self) -> int:
        """Record from now on, from nothing; return now, microseconds of mission clock."""
        with self._lock:
            self._transitions.clear()
            self._recording, self._began_us = True, self._clock_us()
            return self._began_us

    def stop(self) -> None:
        """Record no more; what was recorded can still be fetched."""
        with self._lock:
            self._recording = False

    def fetch(self) -> bytes:
        """Return what was recorded since the start or the last call: nine bytes a transition."""
        with self._lock:
            transitions = b"".join(self._transitions)
            self._transitions.clear()
        return transitions


@dataclass(frozen=True)
class Shown:
    """A tree as viewers see it. ``values``: of each subtree's blackboard, by its name; called by the server's thread."""

    xml: str
    states: NodeStates
    values: Mapping[str, Values]
