"""Addresses of ROS 1 nodes: names resolved, and what to listen on. IPv6 is what ROS_IPV6=on says, as for rospy and roscpp."""

from __future__ import annotations

import os
import socket

LOOPBACK = ("localhost", "127.", "::1")


def own_host() -> str:
    """Return the name or address under which other nodes reach this one: ROS_HOSTNAME, ROS_IP, else this machine's name."""
    return os.environ.get("ROS_HOSTNAME") or os.environ.get("ROS_IP") or socket.gethostname()


def in_uri(host: str) -> str:
    """Return a host as it stands in a URI: an address of IPv6 in brackets."""
    return f"[{host}]" if ":" in host and not host.startswith("[") else host


def bind_address(host: str) -> str:
    """Return the address to listen on: loopback when that is the host name that peers get, else all; of both kinds with ROS_IPV6=on."""
    six = ":" in host or os.environ.get("ROS_IPV6") == "on"
    if host.startswith(LOOPBACK):
        return "::1" if host == "::1" else "127.0.0.1"
    return "::" if six else "0.0.0.0"  # noqa: S104 - other machines' nodes are peers


def resolve(host: str, port: int) -> list[str]:
    """Return the addresses of a host, those of IPv4 first: a node that listens on IPv6 listens on both. Raises OSError."""
    found = socket.getaddrinfo(host.strip("[]"), port, socket.AF_UNSPEC, socket.SOCK_STREAM)
    return list(dict.fromkeys(str(entry[4][0]) for entry in sorted(found, key=lambda entry: entry[0] != socket.AF_INET)))
