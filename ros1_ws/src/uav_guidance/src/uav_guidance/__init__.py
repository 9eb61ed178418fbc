"""Guidance of a multicopter over MAVLink: a pure state machine (`guidance`), a link (`link`) and a thin ROS node (`node`)."""

from uav_guidance.guidance import Guidance
from uav_guidance.settings import GuidanceSettings

__all__ = ["Guidance", "GuidanceSettings"]
