"""The heartbeat of a ROS 2 node that reports resources, as ``resource_reporter`` has it in ROS 1."""

from __future__ import annotations

from rclpy.node import Node
from skillset_interfaces.msg import ResourceState, ResourceStates

from alula.runtime.middleware import REPORTED
from skillset_ros2.mission_clock import STEADY, NodeClock
from skillset_ros2.names import latched

HEARTBEAT_S = 0.5


class Heartbeat:
    """Sends, twice a second by the monotonic clock and by simulated time, that the node which reports some resources is alive.

    Managers reset a resource with a ``silence`` to its initial state when heartbeats stop. A node whose heartbeats are received again has
    to report its state anew: follow ``SkillsetClient.on_change``.
    """

    def __init__(self, node: Node, skillset: str, *resources: str) -> None:
        self._node = node
        self._message = ResourceStates(skillset=skillset, resources=[ResourceState(name=name) for name in resources])
        self._publisher = node.create_publisher(ResourceStates, f"{skillset}/{REPORTED.name}", latched(REPORTED.depth))
        # Managers count a silence by the clock that they have: /clock in a simulation, the monotonic one in a deployment.
        clocks = [STEADY, node.get_clock()] if NodeClock(node).simulated else [STEADY]
        self._timers = [node.create_timer(HEARTBEAT_S, self._beat, clock=clock) for clock in clocks]

    def close(self) -> None:
        """Stop the heartbeat."""
        for timer in self._timers:
            self._node.destroy_timer(timer)
        self._node.destroy_publisher(self._publisher)

    def _beat(self) -> None:
        self._message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(self._message)
