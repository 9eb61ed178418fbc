"""The ROS 1 side of settings: parameters of a node, and changes of them in flight."""

from perception_core.ros.settings import read_settings
from perception_core.ros.tuning import TunableSettings

__all__ = ["TunableSettings", "read_settings"]
