"""Ports and DDS domains for parallel runs on one machine, so that they never meet."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Iterable
from dataclasses import dataclass

# DDS derives its UDP ports from the domain (RTPS 2.5, section 9.6.2.3: 7400 + 250 * domain + ...); above 101 they fall
# into Linux's ephemeral range. 0 is every program's default and left alone.
DOMAINS = range(1, 102)
RTPS_PORT, RTPS_PORTS_PER_DOMAIN = 7400, 250
# Linux takes outgoing connections' ports from 32768 up; the claims of domains lie among these.
EPHEMERAL_PORT = 32_768
PORTS = [port for port in range(20_000, 32_700) if (port - RTPS_PORT) % RTPS_PORTS_PER_DOMAIN]


class NoFreeDomainError(Exception):
    """All DDS domains are claimed by other runs on this machine."""


class NoFreePortError(Exception):
    """Other programs hold all UDP ports that a run of a domain may take; the message names them."""


def free_port() -> int:
    """Return a TCP port on loopback that is free at this moment.

    Below the range that the system takes ports of outgoing connections from: any process could be given a port of that range
    between this look and the moment when our own process listens.
    """
    while True:
        port = secrets.choice(PORTS)
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        return port


def udp_port_is_free(port: int, address: str = "127.0.0.1") -> bool:
    """Tell whether a UDP port of this machine can be bound at this moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, port))
        except OSError:
            return False
    return True


def udp_ports_of(domain: int, *, first: int, step: int, count: int = 1) -> int:
    """Return the first of ``count`` UDP ports in a row on loopback that are free, and that only a run of this DDS domain takes.

    The candidates are ``first`` plus a multiple of ``step``, below the ports of outgoing connections. Who has claimed the domain can't
    meet another run there, however close their starts are; of other programs it is looked that they don't hold the ports.

    Raises:
        NoFreePortError: other programs hold one of each candidate.
    """
    candidates = range(first + step * DOMAINS.index(domain), EPHEMERAL_PORT - count, step * len(DOMAINS))
    for candidate in candidates:
        if all(udp_port_is_free(candidate + n) for n in range(count)):
            return candidate
    raise NoFreePortError(f"other programs hold UDP ports from each of {', '.join(map(str, candidates))} on; end some first")


@dataclass(frozen=True)
class DomainClaim:
    """A DDS domain that no other run uses as long as the socket is open in any process (so also not after a crash)."""

    domain: int
    lock: socket.socket

    def release(self) -> None:
        """Give the domain back, as far as this process is concerned."""
        self.lock.close()


def claim_domain(domains: Iterable[int] = DOMAINS) -> DomainClaim:
    """Claim the first free domain; the kernel gives it back when the last process that has the claim ends, however it ends.

    The claim is the domain's first RTPS port, but of TCP, on loopback: it reaches exactly as far as the domain does, over all users
    and containers that share the network.

    Raises:
        NoFreeDomainError: all are taken.
    """
    tried = 0
    for domain in domains:
        lock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            lock.bind(("127.0.0.1", _claim_port(domain)))
            lock.listen(1)
        except OSError:
            lock.close()
            tried += 1
        else:
            return DomainClaim(domain, lock)
    raise NoFreeDomainError(f"all {tried} DDS domains are in use by other runs on this machine; end some first")


def is_claimed(domain: int) -> bool:
    """Tell whether a run on this machine holds the domain."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            probe.bind(("127.0.0.1", _claim_port(domain)))
        except OSError:
            return True
    return False


def _claim_port(domain: int) -> int:
    return RTPS_PORT + RTPS_PORTS_PER_DOMAIN * domain
