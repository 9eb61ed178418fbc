"""What viewers may see of a tree that is being ticked: stored by the mission, read by the thread that serves."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from threading import Lock

from alula.trees.groot.protocol import IDLE_FROM, Status, Transition, pack_status

KEPT_TRANSITIONS = 1000
"""Of a recording that nobody fetches, the newest; as many as BehaviorTree.CPP keeps."""


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
        self._transitions: deque[Transition] = deque(maxlen=KEPT_TRANSITIONS)

    def changed(self, uid: int, previous: Status, status: Status) -> None:
        """Take a node's change; called by the mission, in the order of the changes."""
        code = IDLE_FROM + previous if status is Status.IDLE else status
        with self._lock:
            self._codes[self._places[uid]] = code
            if self._recording:
                self._transitions.append(Transition(self._clock_us() - self._began_us, uid, status))

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

    def fetch(self) -> list[Transition]:
        """Return what was recorded since the start or the last call."""
        with self._lock:
            transitions = list(self._transitions)
            self._transitions.clear()
        return transitions
