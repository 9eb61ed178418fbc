"""Read the ROS 2 graph by a node."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from ros_bridge.graph import Ros2Endpoint, Ros2Graph, is_bridge

from rclpy.qos import DurabilityPolicy, ReliabilityPolicy  # isort: skip

if TYPE_CHECKING:
    from rclpy.node import Node

UNNAMED = "_NODE_NAME_UNKNOWN_"  # DDS has seen the endpoint, and will hear of its node in a moment


def read_ros2_graph(node: Node) -> Ros2Graph:
    """Return what foreign nodes publish, subscribe and serve now."""
    topics = [name for name, _ in node.get_topic_names_and_types()]
    publishers = {name: _foreign(node.get_publishers_info_by_topic(name)) for name in topics}
    subscribers = {name: _foreign(node.get_subscriptions_info_by_topic(name)) for name in topics}
    services: dict[str, str] = {}
    actions: dict[str, str] = {}
    for name, namespace in node.get_node_names_and_namespaces():
        if not is_bridge(f"{namespace.rstrip('/')}/{name}"):
            services |= _types(_by_node(node.get_service_names_and_types_by_node, name, namespace), "/srv/")
            actions |= _types(_by_node(node.handle.get_action_server_names_and_types_by_node, name, namespace), "/action/")
    return Ros2Graph(
        {name: ends for name, ends in publishers.items() if ends},
        {name: ends for name, ends in subscribers.items() if ends},
        services,
        actions,
    )


def all_named(node: Node) -> bool:
    """Return whether the node of each publisher and subscription of messages that DDS has seen is known."""
    asked = (node.get_publishers_info_by_topic, node.get_subscriptions_info_by_topic)
    ends = (info for name, _ in node.get_topic_names_and_types() for ask in asked for info in ask(name))
    return not any(info.node_name == UNNAMED and "/msg/" in info.topic_type for info in ends)


def _foreign(infos: Iterable[Any]) -> tuple[Ros2Endpoint, ...]:
    ends = [
        Ros2Endpoint(
            f"{info.node_namespace.rstrip('/')}/{info.node_name}",
            info.topic_type.replace("/msg/", "/"),
            reliable=info.qos_profile.reliability == ReliabilityPolicy.RELIABLE,
            transient_local=info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
        )
        for info in infos
        if "/msg/" in info.topic_type and info.node_name != UNNAMED
    ]
    return tuple(end for end in ends if not is_bridge(end.node))


def _by_node(ask: Any, name: str, namespace: str) -> list[tuple[str, list[str]]]:
    """Ask about a node that may have gone since it was listed."""
    try:
        return list(ask(name, namespace))
    except Exception:  # noqa: BLE001 - rclpy has an error of its own for each layer that misses the node
        return []


def _types(found: Iterable[tuple[str, list[str]]], divider: str) -> dict[str, str]:
    return {name: kinds[0].replace(divider, "/") for name, kinds in found if kinds and divider in kinds[0]}
