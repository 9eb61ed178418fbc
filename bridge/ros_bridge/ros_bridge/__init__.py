"""A bridge between ROS 1 and ROS 2: topics, services and actions of any type, as bytes, in one process."""

from ros_bridge.errors import BridgeError

__all__ = ["BridgeError"]
