"""The client of a skillset over rospy."""

from __future__ import annotations

from alula.runtime.client import Client
from skillset_ros1.middleware import RospyMiddleware
from skillset_ros1.names import place


class SkillsetClient(Client):
    """The client of a skillset, in this process's node; callbacks come on a thread of the client's own.

    Args:
        name: the skillset.
        namespace: of the robot, as ``/robot1``; by default that of this process's node.
    """

    def __init__(self, name: str, *, namespace: str = "") -> None:
        self.root = place(namespace, name)
        middleware = RospyMiddleware(name, self.root)
        super().__init__(middleware, name)
        middleware.loop.on_end = lambda: self._sync.close("the node was shut down")
