"""Has the engine told when something is due on the mission clock."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node

from skill_runtime.core.engine import SkillsetEngine

SHORTEST_NS = 1_000_000


class DueTimer:
    """A timer on the node's clock that runs only while the engine waits for a moment."""

    def __init__(self, node: Node, engine: SkillsetEngine) -> None:
        self._node = node
        self._engine = engine
        self._timer: Any = node.create_timer(1.0, self._ring, autostart=False)

    def arm(self) -> None:
        """Look when something is due; called after each step, from any thread."""
        due_ns = self._engine.due_ns
        if due_ns is None:
            return
        self._timer.timer_period_ns = max(SHORTEST_NS, due_ns - int(self._node.get_clock().now().nanoseconds))
        self._timer.reset()

    def _ring(self) -> None:
        self._timer.cancel()
        self._engine.tick()
        self.arm()
