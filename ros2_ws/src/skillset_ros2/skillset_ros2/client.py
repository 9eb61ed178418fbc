"""The client of a skillset over rclpy."""

from __future__ import annotations

from rclpy.node import Node

from alula.runtime.client import Client
from skillset_ros2.middleware import RclpyMiddleware


class SkillsetClient(Client):
    """The client of a skillset, served by the executor that spins a node.

    Args:
        node: whose executor serves the client.
        name: the skillset.
        namespace: of the robot, as ``/robot1``; by default the node's.
    """

    def __init__(self, node: Node, name: str, *, namespace: str = "") -> None:
        self.root = f"{namespace.rstrip('/')}/{name}" if namespace else name
        middleware = RclpyMiddleware(node, name, root=self.root)
        super().__init__(middleware, name)
        middleware.prepare_calls()
