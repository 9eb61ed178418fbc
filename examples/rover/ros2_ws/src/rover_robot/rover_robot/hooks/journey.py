"""What all skills that drive have in common: a goal of an actionlib server in ROS 1, which the bridge shows as an action of ROS 2."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Pose2D
from move_base_msgs.action import MoveBase
from skillset_ros2 import ActionSkill, Ending

if TYPE_CHECKING:
    from alula import Execution
    from skillset_ros2 import Watch

SILENCE_S = 4.0
"""The navigation tells five times a second where it is while it drives; without that it is dead, or the bridge is."""


def ends(arrived: str = "ARRIVED", gave_up: str = "BLOCKED") -> dict[int, str]:
    """Return the results of a skill that drives: the goal was reached; the navigation gave it up, or took another goal."""
    return {GoalStatus.STATUS_SUCCEEDED: arrived, GoalStatus.STATUS_ABORTED: gave_up, GoalStatus.STATUS_CANCELED: gave_up}


class Journey(ActionSkill):
    """Drives to the target, or to what the functional layer knows itself."""

    action, results, lost, silence_s, resumable = MoveBase, ends(), "ABORTED", SILENCE_S, True

    def __init__(self, watch: Watch) -> None:
        super().__init__(watch)
        self._distance_m = self._left_m = 0.0

    def on_dispatch(self, execution: Execution) -> None:
        """Send the goal."""
        self._distance_m = self._left_m = 0.0
        super().on_dispatch(execution)

    def goal(self, inputs: object) -> MoveBase.Goal:
        """Return the target as the navigation wants it."""
        goal, target = MoveBase.Goal(), getattr(inputs, "target", Pose2D())
        goal.target_pose.header.frame_id = "map"
        goal.target_pose.pose.position.x, goal.target_pose.pose.position.y = target.x, target.y
        goal.target_pose.pose.orientation.z = math.sin(target.theta / 2.0)
        goal.target_pose.pose.orientation.w = math.cos(target.theta / 2.0)
        return goal

    def part_done(self, execution: Execution, feedback: Any) -> float:
        """Return the part of the straight line that is behind."""
        here, target = feedback.base_position.pose.position, getattr(execution.inputs, "target", Pose2D())
        self._left_m = math.hypot(target.x - here.x, target.y - here.y)
        self._distance_m = max(self._distance_m, self._left_m)
        return 1.0 - self._left_m / self._distance_m if self._distance_m else 0.0

    def ending(self, execution: Execution, status: int, _answer: Any) -> Ending:
        """Say how far from the target it was given up."""
        if status == GoalStatus.STATUS_SUCCEEDED:
            return Ending(self.results[status])
        told = f" {self._left_m:.1f} m before the target" if hasattr(execution.inputs, "target") else ""
        return Ending(self.results[status], f"{self.server} gave up{told}")
