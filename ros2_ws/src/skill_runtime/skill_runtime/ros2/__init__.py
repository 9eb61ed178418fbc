"""The skillset interface over rclpy: ``SkillsetNode`` (managers), ``SkillsetClient``, ``Robot``, the main function, and their executor."""

from skill_runtime.handle import SkillHandle
from skill_runtime.ros2.client import SkillsetClient
from skill_runtime.ros2.executor import StaticSingleThreadedExecutor
from skill_runtime.ros2.node import SkillsetNode
from skill_runtime.ros2.robot import Robot
from skill_runtime.ros2.spin import run_skillset

__all__ = ["Robot", "SkillHandle", "SkillsetClient", "SkillsetNode", "StaticSingleThreadedExecutor", "run_skillset"]
