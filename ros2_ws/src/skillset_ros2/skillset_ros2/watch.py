"""The mission clock of a node, and what hooks ask several times a second of it."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

PERIOD_S = 0.2


class Watch:
    """Calls what it is given every 0.2 s of mission clock, on the executor of its node: one timer for all hooks of a node."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self._clock = node.get_clock()
        self._looks: list[Callable[[], None]] = []
        node.create_timer(PERIOD_S, self._look)

    @property
    def now_s(self) -> float:
        """Mission clock."""
        return float(self._clock.now().nanoseconds) / 1e9

    def every(self, look: Callable[[], None]) -> None:
        """Call this from now on."""
        self._looks.append(look)

    def _look(self) -> None:
        for look in self._looks:
            look()
