"""Names and qualities of service of the skillset interface, said once for managers and clients."""

from __future__ import annotations

import importlib
from types import ModuleType

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

from alula.model.ros_types import camel

LIVELINESS_LEASE_S = 2.0
"""Without a heartbeat for so long (wall clock), a manager process is taken for dead. Between messages DDS itself tells that it lives."""


OF_ALL_ROBOTS = ("/parameter_events", "/rosout", "/tf", "/tf_static")
"""Topics that nodes of all namespaces share in ROS 2."""


def latched(depth: int) -> QoSProfile:
    """Return the quality of topics that keep their last messages for late subscribers."""
    return QoSProfile(
        depth=depth, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
    )


LATCHED = latched(1)
EVENTS = latched(1000)
ALIVE = QoSProfile(
    depth=1,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    liveliness=LivelinessPolicy.AUTOMATIC,
    liveliness_lease_duration=Duration(seconds=LIVELINESS_LEASE_S),
)
"""``LATCHED`` with heartbeats, for ``alive``."""

SERVICE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
"""Of all services: with ROS's default, the eleventh request of a burst is lost."""
SOURCE = QoSProfile(depth=10)
"""Of the functional layer's topics."""


def in_namespace(name: str) -> str:
    """Return a name of the functional layer, absolute there, as one in the node's namespace: the robot's other nodes lie there, too."""
    return name.lstrip("/")


def names_outside(node: Node) -> list[str]:
    """Return what a node publishes, follows and calls although it lies outside of the node's namespace, which may be another robot's."""
    space = node.get_namespace().rstrip("/")
    named = [
        *(one.topic_name for one in (*node.publishers, *node.subscriptions)),
        *(one.service_name for one in node.clients),
        *(node.resolve_service_name(one._action_name) for one in node.waitables if hasattr(one, "send_goal_async")),  # noqa: SLF001
    ]
    return sorted({name for name in named if not name.startswith(f"{space}/") and name not in OF_ALL_ROBOTS})


def action_module(skillset: str) -> ModuleType:
    """Import the generated actions of a skillset.

    Raises:
        ModuleNotFoundError: they were not built, or their place is not on the path.
    """
    return importlib.import_module(f"{skillset}_interfaces.action")


def action_type(interfaces: ModuleType, skill: str) -> type:
    """Return a skill's action from ``<skillset>_interfaces`` or its ``action`` module.

    Raises:
        AttributeError: it is not in it.
    """
    actions = interfaces if hasattr(interfaces, camel(skill)) else importlib.import_module(f"{interfaces.__name__}.action")
    found = getattr(actions, camel(skill), None)
    if isinstance(found, type):
        return found
    raise AttributeError(f"{interfaces.__name__} has no action {camel(skill)} for skill {skill}; generate and build it again")
