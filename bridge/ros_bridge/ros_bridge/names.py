"""Names of types: ``package/Name``, and ``package/msg/Name`` as rosbags and ROS 2 write it."""

from __future__ import annotations


def msg_name(name: str) -> str:
    """Return ``package/msg/Name`` of ``package/Name``."""
    package, short = name.split("/")
    return f"{package}/msg/{short}"


def plain_name(name: str) -> str:
    """Return ``package/Name`` of ``package/msg/Name``."""
    package, _, short = name.split("/")
    return f"{package}/{short}"
