"""The heartbeat of a ROS 2 node that reports resources, as ``resource_reporter`` has it in ROS 1."""

from __future__ import annotations

from rclpy.node import Node
from skillset_interfaces.msg import ResourceState, ResourceStates

from alula.runtime.middleware import REPORTED
from skillset_ros2.mission_clock import NodeClock
from skillset_ros2.names import latched

HEARTBEAT_S = 0.5


class Heartbeat:
    """Sends a heartbeat twice a second of mission clock: the node that reports these resources is alive.

    Managers take a resource with a ``silence`` back to its initial state when that is not heard any more. A node that is heard again
    has to report anew what it is: follow ``SkillsetClient.on_change``.
    """

    def __init__(self, node: Node, skillset: str, *resources: str) -> None:
        self._node = node
        self._message = ResourceStates(skillset=skillset, resources=[ResourceState(name=name) for name in resources])
        self._publisher = node.create_publisher(ResourceStates, f"{skillset}/{REPORTED.name}", latched(REPORTED.depth))
        self._timer = NodeClock(node).every(HEARTBEAT_S, self._beat)

    def close(self) -> None:
        """Stop the heartbeat."""
        self._node.destroy_timer(self._timer)
        self._node.destroy_publisher(self._publisher)

    def _beat(self) -> None:
        self._message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(self._message)
