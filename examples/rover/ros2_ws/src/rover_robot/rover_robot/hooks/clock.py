"""The mission clock of a node, and what is asked several times a second of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.node import Node

PERIOD_S = 0.2


class Watch:
    """Calls what it is given every 0.2 s of mission clock."""

    def __init__(self, node: Node) -> None:
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
