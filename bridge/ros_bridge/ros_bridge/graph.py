"""The publishers, subscribers and servers of the two worlds, as plain values; without the bridges' own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

LIST_NODE = "ros_bridge_list"
BRIDGE_NODES = frozenset({"ros_bridge", LIST_NODE, "ros1_parameters"})
ANY_TYPE = "*"  # what the ROS master has for a topic that only subscribers of any type have named
ACTION_PARTS = ("goal", "cancel", "status", "feedback", "result")


def is_bridge(node: str) -> bool:
    """Return whether a node (its full name) is a bridge: two of them must not take each other's publications for foreign ones."""
    return node.rpartition("/")[2] in BRIDGE_NODES


@dataclass(frozen=True)
class Ros1Graph:
    """ROS 1: nodes by topic, services' nodes, types (``package/Name`` or ``*``) of topics and services.

    ``services_asked``: services whose nodes are being asked for the types, and have not answered yet.
    """

    publishers: Mapping[str, frozenset[str]] = field(default_factory=dict)
    subscribers: Mapping[str, frozenset[str]] = field(default_factory=dict)
    services: Mapping[str, str] = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)
    service_types: Mapping[str, str] = field(default_factory=dict)
    services_asked: frozenset[str] = frozenset()

    def type_of(self, topic: str) -> str | None:
        """Return a topic's type, or None when it is not known."""
        known = self.types.get(topic, ANY_TYPE)
        return None if known == ANY_TYPE else known

    def action_servers(self) -> dict[str, str]:
        """Return the actions that have a server, and their types as ``package/Name``, by the five topics that make an action."""
        found = {}
        for topic in self.subscribers:
            base = topic.removesuffix("/goal")
            kind = self.types.get(topic, "").removesuffix("ActionGoal")
            is_action = base != topic and f"{base}/status" in self.publishers and kind != self.types.get(topic, "")
            if is_action and self.publishers[f"{base}/status"] & self.subscribers[topic]:
                found[base] = kind
        return found


@dataclass(frozen=True)
class Ros2Endpoint:
    """A publisher or subscription in ROS 2; the type is ``package/Name``."""

    node: str
    type_name: str
    reliable: bool = True
    transient_local: bool = False


@dataclass(frozen=True)
class Ros2Graph:
    """ROS 2: endpoints by topic, types of services and actions that have a server, ``package/Name``."""

    publishers: Mapping[str, tuple[Ros2Endpoint, ...]] = field(default_factory=dict)
    subscribers: Mapping[str, tuple[Ros2Endpoint, ...]] = field(default_factory=dict)
    services: Mapping[str, str] = field(default_factory=dict)
    actions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Graphs:
    """Topics, services and actions of both worlds, as they were read at one moment."""

    ros1: Ros1Graph
    ros2: Ros2Graph
