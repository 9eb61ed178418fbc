"""The mission clock of a node, and periodic calls by it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from skillset_ros2.mission_clock import NodeClock

PERIOD_S = 0.2


class Watch:
    """Calls functions every period of mission clock, on the executor of its node: one timer for all hooks of a node.

    Where nothing publishes ``/clock`` its mission clock is the wall clock without the steps that NTP may take: what hooks
    measure by it does not end early or late. ``Node.create_timer`` and ``Node.get_clock`` follow such a step. There, the timer rests
    while none of the functions is needed: each call wakes the process. With a simulated clock it never rests, so that a run's moments
    are the same whatever has run before.

    Args:
        node: whose executor calls.
        period_s: how often.
        options: those of ``Node.create_timer``, as ``callback_group``.
    """

    def __init__(self, node: Node, period_s: float = PERIOD_S, **options: Any) -> None:
        self.node = node
        self._clock = NodeClock(node)
        self._looks: list[tuple[Callable[[], object], Callable[[], bool]]] = []
        self._lock = threading.Lock()
        self._rests = False
        self._may_rest = not self._clock.simulated
        self._awake_since_s = self.now_s
        self._timer = self._clock.every(period_s, self._look, **options)

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        return self._clock.now_ns() / 1e9

    @property
    def awake_since_s(self) -> float:
        """When it was woken last, or made; mission clock, seconds. What is counted from look to look begins anew then."""
        return self._awake_since_s

    def every(self, look: Callable[[], object], needed: Callable[[], bool] | None = None) -> None:
        """Call ``look()`` every period from now on; while ``needed()`` is False, calls may be left out.

        ``needed`` takes no lock. After it has come to return True, call ``wake``.
        """
        self._looks.append((look, needed or (lambda: True)))
        self.wake()

    def wake(self) -> None:
        """Call every period again: to be called, on any thread, after something has come to be needed."""
        with self._lock:
            if not self._rests:
                return
            self._rests = False
            self._awake_since_s = self.now_s
            self._timer.reset()  # which ends the wait of the executor, too

    def _look(self) -> None:
        for look, _ in self._looks:
            look()
        with self._lock:
            # Whoever makes one needed wakes this afterwards: either it is seen here, or the timer is set anew after this.
            if self._may_rest and not any(needed() for _, needed in self._looks):
                self._rests = True
                self._timer.cancel()
