"""The skillset interface over rclpy: ``SkillsetNode`` (managers), ``SkillsetClient``, helpers for hooks and entry points."""

from skill_runtime.handle import SkillHandle
from skill_runtime.ros2.client import SkillsetClient
from skill_runtime.ros2.hooks_ros import RosHooks
from skill_runtime.ros2.node import SkillsetNode
from skill_runtime.ros2.robot import Robot
from skill_runtime.ros2.spin import run_skillset

__all__ = ["Robot", "RosHooks", "SkillHandle", "SkillsetClient", "SkillsetNode", "run_skillset"]
