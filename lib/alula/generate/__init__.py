"""Makes ROS 2 packages and the bridge's configuration from a robot's models."""

from alula.generate.robot_files import robot_files

__all__ = ["robot_files"]
