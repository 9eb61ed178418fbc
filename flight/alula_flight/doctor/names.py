"""Names and addresses: of this computer, of the master's, and of the peers of ROS 2."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from urllib.parse import urlsplit

import psutil

from alula.common.deployments import Deployment, is_loopback
from alula_flight.doctor.findings import NAMES, Finding, ok, problem


def resolved(host: str) -> str:
    """Return the IPv4 address of a host; empty where its name leads nowhere."""
    try:
        return str(socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_STREAM)[0][4][0])
    except OSError:
        return ""


def own_addresses() -> dict[str, str]:
    """Return this computer's IPv4 addresses, with their interfaces."""
    return {one.address: name for name, all_of in psutil.net_if_addrs().items() for one in all_of if one.family == socket.AF_INET}


def look_at_names(deployment: Deployment) -> Iterator[Finding]:
    """Yield what is to be said of the names and addresses that the deployment's file has."""
    yield _this_computer(deployment)
    master = urlsplit(deployment.master).hostname or ""
    for what, host in [("the master's computer", master), *(("the peer", peer) for peer in deployment.peers)]:
        address = resolved(host)
        if not address:
            yield problem(NAMES, f"{what}, {host}, is not known here", f"write a line `ADDRESS {host}` into /etc/hosts of this computer")
        elif host == master and is_loopback(address) and not is_loopback(host):
            remedy = f"write the address that others reach it by into /etc/hosts, instead of {address}"
            yield problem(NAMES, f"{what}, {host}, is {address} here, which no other computer reaches", remedy)
        else:
            yield ok(NAMES, f"{what} is {host}{'' if host == address else f', {address}'}")


def _this_computer(deployment: Deployment) -> Finding:
    host, own = deployment.address, own_addresses()
    address = resolved(host)
    others = ", ".join(one for one in own if not is_loopback(one)) or "none"
    if not address:
        return problem(
            NAMES, f"`address: {host}` is not known here", f"write a line `ADDRESS {host}` into /etc/hosts of both computers ({others})"
        )
    if is_loopback(address) and not is_loopback(host):
        return problem(
            NAMES,
            f"`address: {host}` is {address} here: our nodes would listen where no other computer reaches them",
            f"give {host} its own address in /etc/hosts ({others}); Debian writes 127.0.1.1 there",
        )
    if address not in own and not is_loopback(address):
        return problem(
            NAMES, f"`address: {host}` is no address of this computer", f"write one that it has ({others}) into {deployment.path}"
        )
    return ok(NAMES, f"this computer is {host}{'' if host == address else f', {address}'}")
