"""The skillset interface over rclpy: managers, clients, and bases of skills whose function is an action or a service."""

from alula.runtime.handle import SkillHandle
from skillset_ros2.action_client import ActionClient
from skillset_ros2.action_skill import ActionSkill
from skillset_ros2.base import QUIET
from skillset_ros2.client import SkillsetClient
from skillset_ros2.executor import NodeExecutor
from skillset_ros2.function_skill import Ending
from skillset_ros2.heartbeat import Heartbeat
from skillset_ros2.node import SkillsetNode
from skillset_ros2.robot import Robot
from skillset_ros2.service_skill import ServiceSkill
from skillset_ros2.slower_clock import SlowerClock
from skillset_ros2.spin import run_skillset
from skillset_ros2.watch import Watch

__all__ = [
    "QUIET",
    "ActionClient",
    "ActionSkill",
    "Ending",
    "Heartbeat",
    "NodeExecutor",
    "Robot",
    "ServiceSkill",
    "SkillHandle",
    "SkillsetClient",
    "SkillsetNode",
    "SlowerClock",
    "Watch",
    "run_skillset",
]
