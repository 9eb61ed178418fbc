"""ROS 2 on this computer: how far DDS is bound, multicast, shared memory, who is in the domain, and whether a skillset is served twice."""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import shutil
import socket
import struct
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import ParseError, fromstring

from alula.common.deployments import Deployment, Discovery, is_loopback
from alula.common.fast_dds import leave
from alula_flight.doctor.findings import ROS2, Finding, listed, note, ok, problem
from alula_flight.doctor.names import own_addresses, resolved

if TYPE_CHECKING:
    from rclpy.node import Node

GROUP, PORT = "239.255.0.1", 7399
"""DDS's own group (RTPS 2.5, 9.6.2.4), and a port that no domain has."""
MULTICAST_S, QUIET_S, FOUND_S, MOST_S = 1.0, 1.0, 5.0, 10.0
"""Others are looked for until none has come for a moment, and at least so long: what announces us may be lost, and Fast DDS announces
us again after three seconds."""
SHARED, SEGMENT = Path("/dev/shm"), 64 << 20  # noqa: S108 - where shared memory lies
INTERFACE_FLAGS, MULTICAST_FLAG = 0x8913, 0x1000
"""Of Linux: SIOCGIFFLAGS, IFF_MULTICAST."""


def bound_to(profile: str) -> list[str]:
    """Return the addresses that a profile of Fast DDS binds to; none: all of them."""
    try:
        root = fromstring(profile)  # noqa: S314 - a file of this computer
    except ParseError:
        return []
    every = (one for entry in root.iter() if entry.tag.endswith("interfaceWhiteList") for one in entry)
    return list(dict.fromkeys((one.text or "").strip() for one in every))


def look_at_reach(deployment: Deployment, profile: str) -> Iterator[Finding]:
    """Yield how far nodes of ROS 2 see each other; ``profile``: the text of Fast DDS's, empty where there is none."""
    bound = bound_to(profile)
    own_only = bool(bound) and all(map(is_loopback, bound))
    if deployment.discovery is Discovery.LOCALHOST:
        bound_words = f", and DDS's profile binds to {', '.join(bound)}" if bound else ""
        yield ok(ROS2, f"it stays on this computer: `discovery: LOCALHOST`{bound_words}. Others take SUBNET, or OFF and `peers`")
        return
    if own_only:
        yield problem(
            ROS2,
            f"`discovery: {deployment.discovery.value}`, but DDS's profile binds to {', '.join(bound)}: nobody else is ever found",
            f"give `ros1: address` of {deployment.path} this computer's address: DDS binds to it, too",
        )
        return
    yield ok(ROS2, f"`discovery: {deployment.discovery.value}`; DDS binds to {', '.join(bound) or 'all interfaces'}")
    if deployment.discovery is Discovery.SUBNET:
        yield look_at_multicast(resolved(deployment.address))
    elif not deployment.peers:
        yield problem(ROS2, "`discovery: OFF` without `peers`: no other computer is found", f"write `peers` into {deployment.path}")


def look_at_multicast(address: str) -> Finding:
    """Return whether what is sent to DDS's group by our interface is heard there: others are found by it."""
    interface = own_addresses().get(address, "")
    remedy = "allow multicast on that interface (ip link set DEV multicast on; many WiFi routers drop it), or name the computers in `peers`"
    if not interface:
        return note(ROS2, f"multicast was not tried: {address or 'the address'} is not this computer's")
    if not multicast_flag(interface):
        return problem(ROS2, f"{interface} does not take multicast: no other computer is found", remedy)
    try:
        heard = _multicast_heard(address)
    except OSError as error:
        return problem(ROS2, f"multicast by {interface}: {error.strerror or error}", remedy)
    if not heard:
        return problem(ROS2, f"multicast by {interface} is sent, and not received", remedy)
    return ok(ROS2, f"multicast goes out by {interface} and is received here; a switch or router may still drop it")


def multicast_flag(interface: str) -> bool:
    """Return whether an interface says that it takes multicast."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        answer = fcntl.ioctl(one, INTERFACE_FLAGS, struct.pack("16sH14s", interface.encode()[:15], 0, b""))
    return bool(struct.unpack("16sH14s", answer)[1] & MULTICAST_FLAG)


def _multicast_heard(address: str) -> bool:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        receiver.bind((GROUP, PORT))
        receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(GROUP) + socket.inet_aton(address))
        receiver.settimeout(MULTICAST_S)
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address))
        word = f"alula doctor {os.getpid()}".encode()
        sender.sendto(word, (GROUP, PORT))
        end_s = time.monotonic() + MULTICAST_S
        with contextlib.suppress(TimeoutError):
            while time.monotonic() < end_s:
                if receiver.recv(100) == word:
                    return True
    return False


def look_at_shared_memory(parts: int, folder: Path = SHARED) -> Finding:
    """Return whether there is room for the segments of so many processes, and for ours."""
    try:
        free = shutil.disk_usage(folder).free
    except OSError as error:
        return problem(ROS2, f"{folder}: {error.strerror}: messages within this computer would go by UDP", f"mount -t tmpfs tmpfs {folder}")
    if not os.access(folder, os.W_OK):
        return problem(ROS2, f"{folder} can't be written: messages within this computer would go by UDP", f"chmod 1777 {folder}")
    needed = (parts + 1) * SEGMENT
    words = f"{free / 1e6:.0f} MB of shared memory are free in {folder}, {parts + 1} processes take up to {needed / 1e6:.0f}"
    if free < needed:
        left = f"fastrtps_* in {folder} of processes that were killed can go; a container takes --shm-size"
        return problem(ROS2, words, left)
    return ok(ROS2, words)


# --- the graph --------------------------------------------------------------------------------------------------------


def look_at_graph(deployment: Deployment, running: Iterable[str]) -> Iterator[Finding]:
    """Yield who is in the domain, and whether each skillset is served once; ``running``: the parts that run here.

    This process's environment has to be that of the deployment's parts.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node("alula_doctor")
        try:
            nodes = _nodes_when_quiet(node)
            servers = {name: _servers(node, f"{deployment.namespace}/{name}") for name in deployment.managers}
        finally:
            leave(node)
    finally:
        rclpy.try_shutdown()
    yield ok(ROS2, f"DDS domain {deployment.domain}: {f'{len(nodes)} nodes, {listed(nodes)}' if nodes else 'nobody is there'}")
    here = {name for part in running for name in deployment.served.get(part, ())}
    yield from look_at_servers(servers, here, deployment.domain)


def look_at_servers(servers: Mapping[str, list[str]], running: set[str], domain: int) -> Iterator[Finding]:
    """Yield which skillsets are served twice, and which are not seen though their managers run here: those in ``running``."""
    for name, nodes in servers.items():
        if len(nodes) > 1:
            yield problem(
                ROS2,
                f"{name} has {len(nodes)} managers in domain {domain} ({', '.join(nodes)}): each takes requests",
                "end all but one: alula run or alula up on another computer, a forgotten process; or give each robot a domain of its own",
            )
        elif not nodes and name in running:
            yield problem(
                ROS2,
                f"the managers of {name} run here, and are not seen in domain {domain}",
                "alula up again: it was started in another graph; what it says is in its log (alula status)",
            )


def _nodes_when_quiet(node: Node) -> list[str]:
    """Return the other nodes' names when none has come for a moment."""
    begun_s, seen, since_s = time.monotonic(), -1, time.monotonic()
    while time.monotonic() < min(begun_s + MOST_S, max(begun_s + FOUND_S, since_s + QUIET_S)):
        count = len(node.get_topic_names_and_types()) + len(node.get_node_names())
        if count != seen:
            seen, since_s = count, time.monotonic()
        time.sleep(QUIET_S / 10.0)
    names = (f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces())
    return sorted(name for name in names if not re.search(r"/alula_doctor$", name))


def _servers(node: Node, skillset: str) -> list[str]:
    infos = node.get_publishers_info_by_topic(f"{skillset}/resource_states")
    return sorted(f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos)
