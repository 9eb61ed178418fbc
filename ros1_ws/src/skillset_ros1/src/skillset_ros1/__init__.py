"""The skillset interface over rospy: ``SkillsetManagers``, ``SkillsetClient``, service calls with time limits, and the main function."""

from alula.runtime.handle import SkillHandle
from skillset_ros1.calls import ServiceCallError, call, call_and_wait
from skillset_ros1.client import SkillsetClient
from skillset_ros1.main import run_skillset
from skillset_ros1.managers import SkillsetManagers

__all__ = ["ServiceCallError", "SkillHandle", "SkillsetClient", "SkillsetManagers", "call", "call_and_wait", "run_skillset"]
