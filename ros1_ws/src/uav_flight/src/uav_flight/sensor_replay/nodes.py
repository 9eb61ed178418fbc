"""The perception's nodes, by name; imports no ROS, so that both worlds can tell which settings are theirs."""

from __future__ import annotations

NODES = ("zed_depth", "lidar_obstacles", "lidar_mapping")
"""The nodes that perceive."""


def is_setting(text: str) -> bool:
    """Tell whether ``NODE.NAME=VALUE`` is about one of the nodes, and not a parameter of the mission."""
    return node_and_parameter(text)[0] in NODES


def node_and_parameter(text: str) -> tuple[str, str]:
    """Return what ``NODE.NAME=VALUE`` names, a skillset before it left out."""
    name = text.partition("=")[0]
    node, _, parameter = name.removeprefix("perception.").removeprefix("mapping.").partition(".")
    return node, parameter
