"""A node as a core without ROS, and what runs it: a ROS 1 graph (``node_core.ros``) or a bag (``node_core.replay``)."""

from node_core.core import Core, Host, Input, Output

__all__ = ["Core", "Host", "Input", "Output"]
