"""The skillset interface over rclpy: ``SkillsetNode`` (managers), ``SkillsetClient``, ``Robot``, the main function, and their executor."""

from alula.runtime.handle import SkillHandle
from skillset_ros2.client import SkillsetClient
from skillset_ros2.executor import NodeExecutor
from skillset_ros2.node import SkillsetNode
from skillset_ros2.robot import Robot
from skillset_ros2.spin import run_skillset

__all__ = ["NodeExecutor", "Robot", "SkillHandle", "SkillsetClient", "SkillsetNode", "run_skillset"]
