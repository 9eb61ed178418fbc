"""The skillset interface over rclpy: ``SkillsetNode`` (managers), ``SkillsetClient``, ``Robot``, ``ActionClient``, their executor."""

from alula.runtime.handle import SkillHandle
from skillset_ros2.action_client import ActionClient
from skillset_ros2.base import QUIET
from skillset_ros2.client import SkillsetClient
from skillset_ros2.executor import NodeExecutor
from skillset_ros2.node import SkillsetNode
from skillset_ros2.robot import Robot
from skillset_ros2.spin import run_skillset

__all__ = ["QUIET", "ActionClient", "NodeExecutor", "Robot", "SkillHandle", "SkillsetClient", "SkillsetNode", "run_skillset"]
