"""What all skills that drive have in common: a goal of an actionlib server in ROS 1, which the bridge shows as an action of ROS 2."""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING, Any

from action_msgs.msg import GoalStatus
from alula import SkillHooks
from geometry_msgs.msg import Pose2D
from move_base_msgs.action import MoveBase
from skillset_ros2 import ActionClient

if TYPE_CHECKING:
    from alula import Execution
    from rclpy.node import Node

    from rover_robot.hooks.clock import Watch

SILENT_S = 4.0
"""The navigation tells five times a second where it is while it drives; without that it is dead, or the bridge is."""


class Journey(SkillHooks):
    """Sends a goal, follows its feedback, and says how it ended. One at a time: the model's resource `wheels` sees to that."""

    arrived, blocked, aborted = "ARRIVED", "BLOCKED", "ABORTED"
    """Results: the goal was reached; the navigation gave it up; it refuses, or is silent."""

    def __init__(self, node: Node, watch: Watch, server: str) -> None:
        super().__init__()
        self._client = ActionClient(node, MoveBase, server)
        self._server, self._watch = server, watch
        self._lock = threading.RLock()
        self._execution: Execution | None = None
        self._goal = 0
        """Grows with each goal: what is heard of an older one is nothing to this execution any more."""
        self._handle: Any = None
        self._target = Pose2D()
        self._heard_s = self._distance_m = self._left_m = 0.0
        self._paused = False
        watch.every(self._look)

    # --- hooks --------------------------------------------------------------------------------------------------------

    def on_dispatch(self, execution: Execution) -> None:
        """Send the goal."""
        with self._lock:
            self._execution, self._paused, self._distance_m = execution, False, 0.0
            self._target = getattr(execution.inputs, "target", Pose2D())
            self._send()

    def progress(self, execution: Execution) -> float:
        """Return the part of the straight line that is behind."""
        if execution is not self._execution or not self._distance_m:
            return 0.0
        return min(max(1.0 - self._left_m / self._distance_m, 0.0), 1.0)

    def on_interrupt(self, execution: Execution) -> None:
        """Cancel the goal: the navigation stops the wheels then."""
        with self._lock:
            if execution is self._execution:
                self._execution = None
                self._cancel()

    def on_pause(self, execution: Execution) -> str:
        """Cancel the goal, and keep the target."""
        with self._lock:
            if execution is not self._execution:
                return "it has ended"
            self._paused = True
            self._cancel()
        return ""

    def on_resume(self, execution: Execution) -> str:
        """Send the goal again."""
        with self._lock:
            if execution is not self._execution:
                return "it has ended"
            self._paused = False
            self._send()
        return ""

    # --- the goal -----------------------------------------------------------------------------------------------------

    def _send(self) -> None:
        self._goal += 1
        goal, number = MoveBase.Goal(), self._goal
        goal.target_pose.header.frame_id = "map"
        goal.target_pose.pose.position.x, goal.target_pose.pose.position.y = self._target.x, self._target.y
        goal.target_pose.pose.orientation.z = math.sin(self._target.theta / 2.0)
        goal.target_pose.pose.orientation.w = math.cos(self._target.theta / 2.0)
        self._handle, self._heard_s = None, self._watch.now_s
        sent = self._client.send_goal_async(goal, lambda feedback: self._on_feedback(number, feedback.feedback))
        sent.add_done_callback(lambda future: self._on_answer(number, future.result()))

    def _cancel(self) -> None:
        """Cancel the goal; one that is not accepted yet is cancelled when it is."""
        self._goal += 1
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def _on_answer(self, number: int, handle: Any) -> None:
        with self._lock:
            if number != self._goal:
                if handle.accepted:
                    handle.cancel_goal_async()
            elif not handle.accepted:
                self._end(self.aborted, f"{self._server} refuses the goal")
            else:
                self._handle = handle
                handle.get_result_async().add_done_callback(lambda future: self._on_result(number, future.result().status))

    def _on_feedback(self, number: int, feedback: Any) -> None:
        here = feedback.base_position.pose.position
        with self._lock:
            if number == self._goal:
                self._heard_s = self._watch.now_s
                self._left_m = math.hypot(self._target.x - here.x, self._target.y - here.y)
                self._distance_m = max(self._distance_m, self._left_m)

    def _on_result(self, number: int, status: int) -> None:
        with self._lock:
            if number != self._goal or self._execution is None:
                return
            if status == GoalStatus.STATUS_SUCCEEDED:
                self._end(self.arrived, "")
            elif self._client.server_is_ready():
                told = f" {self._left_m:.1f} m before the target" if hasattr(self._execution.inputs, "target") else ""
                self._end(self.blocked, f"{self._server} gave up{told}")
            else:
                self._end(self.aborted, f"{self._server} is gone")

    def _look(self) -> None:
        with self._lock:
            if self._execution is not None and not self._paused and self._watch.now_s - self._heard_s > SILENT_S:
                self._cancel()
                self._end(self.aborted, f"nothing is heard of {self._server} for {SILENT_S:g} s")

    def _end(self, result: str, message: str) -> None:
        execution, self._execution = self._execution, None
        if execution is not None:
            execution.terminate(result, message=message)
