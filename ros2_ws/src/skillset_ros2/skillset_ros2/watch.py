"""The mission clock of a node, and periodic calls by it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from skillset_ros2.mission_clock import NodeClock

PERIOD_S = 0.2


class Watch:
    """Calls functions every period of mission clock, on the executor of its node: one timer for all hooks of a node.

    Where nothing publishes ``/clock`` its mission clock is the wall clock without the steps that NTP may take: what hooks
    measure by it does not end early or late. ``Node.create_timer`` and ``Node.get_clock`` follow such a step.

    Args:
        node: whose executor calls.
        period_s: how often.
        options: those of ``Node.create_timer``, as ``callback_group``.
    """

    def __init__(self, node: Node, period_s: float = PERIOD_S, **options: Any) -> None:
        self.node = node
        self._clock = NodeClock(node)
        self._looks: list[Callable[[], None]] = []
        self._clock.every(period_s, self._look, **options)

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        return self._clock.now_ns() / 1e9

    def every(self, look: Callable[[], None]) -> None:
        """Call ``look()`` every period from now on."""
        self._looks.append(look)

    def _look(self) -> None:
        for look in self._looks:
            look()
