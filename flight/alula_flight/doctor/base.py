"""The ROS 1 graph as the master has it, and who of it can be reached from here, and back."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit
from xmlrpc.server import SimpleXMLRPCServer

from alula.common.deployments import Deployment, is_loopback
from alula_flight.doctor.findings import MASTER, NODES, Finding, listed, ok, problem
from alula_flight.doctor.names import own_addresses, resolved
from alula_flight.station.master import why_no_master
from ros_bridge.addresses import bind_address, in_uri
from ros_bridge.graph import is_bridge
from ros_bridge.master import Connection, RefusedError

WITHIN_S = 2.0
"""For one answer (wall clock): a computer beside this one takes milliseconds."""
BACK_S = 3.0
AT_A_TIME = 32
CALLER = "/alula_doctor"
WAY_BACK = "/alula_doctor/way_back"
ANNOUNCE = "on the computer where it runs: export ROS_IP=ITS_ADDRESS (or ROS_HOSTNAME) before it is started"


@dataclass(frozen=True)
class Base:
    """What the master knows: nodes by topic and service, types of topics, addresses of nodes."""

    master: str
    publishers: Mapping[str, frozenset[str]]
    subscribers: Mapping[str, frozenset[str]]
    services: Mapping[str, str]
    types: Mapping[str, str]
    uris: Mapping[str, str]


def look_at_master(deployment: Deployment) -> tuple[list[Finding], Base | None]:
    """Return what is to be said of the master, and what it knows; None where it does not answer."""
    uri = deployment.master
    why = why_no_master(uri)
    if why:
        return [problem(MASTER, f"no ROS master at {uri}: {why}", _remedy_of_silence(uri, why))], None
    try:
        return [ok(MASTER, f"it answers at {uri}"), *_own_address(uri)], read_base(uri)
    except OSError as error:
        return [problem(MASTER, f"it answers at {uri}, but not to a question: {error}", "restart roscore there")], None


def _remedy_of_silence(uri: str, why: str) -> str:
    host, port = urlsplit(uri).hostname, urlsplit(uri).port
    if "refused" in why:
        return f"start roscore on {host}, or correct the port {port} of `ros1: master`"
    if "answers" in why or "route" in why or "unreachable" in why:
        return f"is {host} on, and in this network (ping {host})? Does a firewall there let TCP through, to all ports of nodes?"
    return "correct `ros1: master`"


def _own_address(uri: str) -> Iterator[Finding]:
    """Yield what is wrong with the address that the master says it has: tools of ROS 1 use it."""
    with suppress(OSError):
        said = str(Connection(uri, WITHIN_S).call("getUri", CALLER))
        host = urlsplit(said).hostname or ""
        away = not is_loopback(resolved(urlsplit(uri).hostname or ""))
        if not resolved(host):
            remedy = f"write a line `ADDRESS {host}` into /etc/hosts here, or export ROS_IP before roscore is started there"
            yield problem(MASTER, f"it calls itself {said}, and {host} is not known here", remedy)
        elif away and is_loopback(resolved(host)) and not is_loopback(host):
            remedy = f"give {host} its own address in /etc/hosts here, or export ROS_IP before roscore is started there"
            yield problem(MASTER, f"it calls itself {said}, and {host} is this computer here", remedy)


def read_base(uri: str) -> Base:
    """Ask the master for all that it knows; raises OSError."""
    master = Connection(uri, WITHIN_S)
    try:
        publishers, subscribers, services = master.call("getSystemState", CALLER)
        types = {str(name): str(kind) for name, kind in master.call("getTopicTypes", CALLER)}
        nodes = {str(node) for entries in (publishers, subscribers, services) for _, every in entries for node in every}
        nodes = {node for node in nodes if not node.startswith(CALLER)}  # a busy master may not have taken a doctor's leave yet
        uris = {}
        for node in sorted(nodes):
            with suppress(RefusedError):  # it has gone meanwhile
                uris[node] = str(master.call("lookupNode", CALLER, node))
    finally:
        master.close()
    return Base(
        uri,
        {str(name): frozenset(map(str, every)) for name, every in publishers},
        {str(name): frozenset(map(str, every)) for name, every in subscribers},
        {str(name): str(every[0]) for name, every in services if every},
        types,
        uris,
    )


# --- from here to them ------------------------------------------------------------------------------------------------


def look_at_nodes(base: Base) -> tuple[list[Finding], frozenset[str]]:
    """Return what is to be said of the nodes' addresses, and which nodes can be reached."""
    away = not is_loopback(resolved(urlsplit(base.master).hostname or ""))
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        reached = dict(zip(base.uris, pool.map(lambda uri: why_unreachable(uri, away=away), base.uris.values()), strict=True))
    by_reason: dict[tuple[str, str], list[str]] = {}
    for node, why in reached.items():
        if why is not None:
            by_reason.setdefault(why, []).append(node)
    found = [problem(NODES, f"{listed(nodes)} {what}", remedy) for (what, remedy), nodes in by_reason.items()]
    good = frozenset(node for node, why in reached.items() if why is None)
    return [*found, ok(NODES, f"{len(good)} of {len(reached)} nodes answer at the address that they announce")], good


def why_unreachable(uri: str, *, away: bool) -> tuple[str, str] | None:
    """Return why a node can't be reached, and what to do; None where it answers. ``away``: the master is on another computer."""
    host, port = urlsplit(uri).hostname or "", urlsplit(uri).port or 0
    address = resolved(host)
    if not address:
        return f"announced as {host}, which is not known here", f"write a line `ADDRESS {host}` into /etc/hosts here; or {ANNOUNCE}"
    if away and is_loopback(address):
        known = host if host == address else f"{host}, here {address}"
        return f"announced as {known}, where no other computer reaches it", ANNOUNCE
    try:
        socket.create_connection((address, port), timeout=WITHIN_S).close()
    except TimeoutError:
        return f"announced as {host}, where nothing answers", f"{ANNOUNCE}; or a firewall there keeps its ports shut"
    except ConnectionRefusedError:
        return f"announced as {host}, where nothing listens any more: it died without telling the master", "rosnode cleanup, or restart it"
    except OSError as error:
        return f"announced as {host}: {error.strerror or error}", ANNOUNCE
    return None


# --- from them to here ------------------------------------------------------------------------------------------------


def look_at_way_back(deployment: Deployment) -> Finding:
    """Return whether the master's computer reaches this one by the address that the deployment announces.

    The master is told of a subscriber at that address, and of a publisher: it then calls the subscriber.
    """
    address = deployment.address
    if address not in own_addresses() and resolved(address) not in own_addresses() and not is_loopback(address):
        return problem(NODES, f"the way back was not tried: {address} is not this computer's", "correct `ros1: address`")
    called = threading.Event()

    def publisher_update(*_: Any) -> Any:  # caller, topic, publishers
        called.set()
        return 1, "", 0

    with SimpleXMLRPCServer((bind_address(address), 0), logRequests=False) as server:
        server.register_function(publisher_update, "publisherUpdate")
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            arrived = _have_it_call(deployment, server.server_address[1], called)
        except OSError as error:
            return problem(NODES, f"the way back was not tried: {error}", "restart roscore")
        finally:
            server.shutdown()
    if arrived:
        return ok(NODES, f"the master's computer reaches this one at {address}")
    host = urlsplit(deployment.master).hostname
    known = f"write a line `ADDRESS {address}` into /etc/hosts of {host}" if address not in own_addresses() else f"ping {address} on {host}"
    return problem(NODES, f"the master's computer does not reach this one at {address}: no topic would come", f"{known}; a firewall here?")


def _have_it_call(deployment: Deployment, port: int, called: threading.Event) -> bool:
    me, uri = f"{CALLER}_{os.getpid()}", f"http://{in_uri(deployment.address)}:{port}"
    master = Connection(deployment.master, WITHIN_S)
    try:
        master.call("registerSubscriber", me, WAY_BACK, "std_msgs/Empty", uri)
        master.call("registerPublisher", me, WAY_BACK, "std_msgs/Empty", uri)
        return called.wait(BACK_S)
    finally:
        for leave in ("unregisterSubscriber", "unregisterPublisher"):
            with suppress(OSError):
                master.call(leave, me, WAY_BACK, uri)
        master.close()


def foreign(nodes: Iterable[str], *, bridges: bool) -> frozenset[str]:
    """Return which of the nodes are bridges, or which are none."""
    return frozenset(node for node in nodes if is_bridge(node) is bridges and not node.startswith(CALLER))
