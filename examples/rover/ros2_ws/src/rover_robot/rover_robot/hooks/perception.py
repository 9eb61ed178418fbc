"""The hooks of the skillset `perception`: an eye that is heard of is open."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from alula import SkillHooks
from perception_managers.hooks import AbstractBumperSkill, AbstractScanSkill
from sensor_msgs.msg import LaserScan
from skillset_ros2 import Watch
from std_msgs.msg import Bool

if TYPE_CHECKING:
    from alula import Execution
    from rclpy.node import Node

SILENT_S = 2.0
"""The functional layer notices silence after 0.5 s and says why (resource `laser`); this is for when it is silent itself."""


class Eye(SkillHooks):
    """Runs as long as messages of a topic come."""

    def __init__(self, node: Node, watch: Watch, topic: str, kind: type) -> None:
        super().__init__()
        self._topic, self._watch = topic, watch
        self._execution: Execution | None = None
        self._since_s = self._heard_s = 0.0
        node.create_subscription(kind, topic, self._hear, 5)
        watch.every(self._look, lambda: self._execution is not None)

    def on_dispatch(self, execution: Execution) -> None:
        """Begin to listen."""
        self._since_s, self._execution = self._watch.now_s, execution
        self._watch.wake()

    def progress(self, execution: Execution) -> float:
        """Return 1 once something has come."""
        return 1.0 if execution is self._execution and self._heard_s > self._since_s else 0.0

    def on_interrupt(self, execution: Execution) -> None:
        """Listen no more."""
        if execution is self._execution:
            self._execution = None

    def _hear(self, _message: Any) -> None:
        self._heard_s = self._watch.now_s

    def _look(self) -> None:
        execution = self._execution
        if execution is not None and self._watch.now_s - max(self._since_s, self._heard_s) > SILENT_S:
            self._execution = None
            execution.terminate("LOST", message=f"nothing comes on {self._topic} for {SILENT_S:g} s")


class Scan(Eye, AbstractScanSkill):
    """The laser."""


class Bumper(Eye, AbstractBumperSkill):
    """The bumper."""


def make_hooks(node: Node) -> dict[str, SkillHooks]:
    """Make the hooks of all skills."""
    watch = Watch(node)
    return {"scan": Scan(node, watch, "scan", LaserScan), "bumper": Bumper(node, watch, "bumper", Bool)}
