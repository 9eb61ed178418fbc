"""A bridge between ROS 1 and ROS 2: topics and services of any type, as raw bytes, in one Python process."""

from ros_bridge.errors import BridgeError

__all__ = ["BridgeError"]
