"""Ports and DDS domains for parallel runs on one machine, so that they never meet."""

from __future__ import annotations

import re
import secrets
import socket
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from alula.common.errors import AlulaError

# DDS derives its UDP ports from the domain (RTPS 2.5, section 9.6.2.3: 7400 + 250 * domain + ...); above 101 they fall
# into Linux's ephemeral range. 0 is every program's default and left alone.
DOMAINS = range(1, 102)
RTPS_PORT, RTPS_PORTS_PER_DOMAIN = 7400, 250
# Linux takes outgoing connections' ports from 32768 up; the claims of domains lie among these.
EPHEMERAL_PORT = 32_768
PORTS = [port for port in range(20_000, 32_700) if (port - RTPS_PORT) % RTPS_PORTS_PER_DOMAIN]
CLAIMED_PORTS = 64
_claims: deque[socket.socket] = deque()


NAMESPACE = re.compile(r"(/[A-Za-z][A-Za-z0-9_]*)+")


class NoFreeDomainError(AlulaError):
    """The DDS domains that a run may have, or its namespace there, are claimed by other runs on this machine."""


class NoFreePortError(AlulaError):
    """Other programs hold all UDP ports that a run of a domain may take; the message names them."""


def free_port(count: int = 1) -> int:
    """Return the first of ``count`` TCP ports in a row that are free on loopback now, and that no other process of Alula is given.

    Below the range that the system takes ports of outgoing connections from: any process could be given a port of that range
    between this look and the moment when our own process listens. The claim is the name of a socket; a process holds its latest
    ``CLAIMED_PORTS``, as long as it lives.
    """
    while True:
        first = secrets.choice(PORTS)
        claims = [claim for claim in map(_claimed, range(first, first + count)) if claim is not None]
        if len(claims) < count:
            for claim in claims:
                claim.close()
            continue
        _claims.extend(claims)
        while len(_claims) > CLAIMED_PORTS:
            _claims.popleft().close()
        return first


def _claimed(port: int) -> socket.socket | None:
    """Return what holds a TCP port for this process, or None where another has it, or it is none of those that are given."""
    if port not in PORTS:
        return None
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            claim.bind(f"\0alula/port/{port}")
            probe.bind(("127.0.0.1", port))
        except OSError:
            claim.close()
            return None
    return claim


def udp_port_is_free(port: int, address: str = "127.0.0.1") -> bool:
    """Return whether a UDP port of this machine can be bound at this moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, port))
        except OSError:
            return False
    return True


def udp_ports_of(seat: int, *, first: int, step: int, count: int = 1) -> int:
    """Return the first of ``count`` UDP ports in a row on loopback that are free, and that only the run with this seat takes.

    The candidates are ``first`` plus a multiple of ``step``, below the ports of outgoing connections. Who has claimed the seat can't
    meet another run there, however close their starts are; of other programs it is looked that they don't hold the ports.

    Raises:
        NoFreePortError: other programs hold one of each candidate.
    """
    candidates = range(first + step * DOMAINS.index(seat), EPHEMERAL_PORT - count, step * len(DOMAINS))
    for candidate in candidates:
        if all(udp_port_is_free(candidate + n) for n in range(count)):
            return candidate
    raise NoFreePortError(f"other programs hold UDP ports from each of {', '.join(map(str, candidates))} on; end some first")


@dataclass(frozen=True)
class DomainClaim:
    """What a run has to itself as long as the sockets are open in any process (so also not after a crash).

    Attributes:
        domain: DDS domain of the run. Only runs that lie in namespaces, each in its own, share one.
        seat: a number that no other run has, for what follows from it, as UDP ports.
        locks: what holds both.
    """

    domain: int
    seat: int
    locks: tuple[socket.socket, ...]

    def release(self) -> None:
        """Give all of it back, as far as this process is concerned."""
        for lock in self.locks:
            lock.close()


def claim_domain(domains: Iterable[int] = DOMAINS, namespace: str = "") -> DomainClaim:
    """Claim the first free domain; the kernel gives it back when the last process that has the claim ends, however it ends.

    With a namespace (absolute), a domain that is the only one to choose from is free, too, where all other runs have namespaces, and none
    of them this one. The claims reach exactly as far as the domain does, over all users and containers that share the network; runs of
    one user share a domain.

    Raises:
        NoFreeDomainError: all are taken.
    """
    domains = tuple(domains)
    for domain in domains:
        locks = () if namespace and len(domains) > 1 and is_claimed(domain) else _lock(domain, namespace)
        if locks and not namespace:
            return DomainClaim(domain, domain, locks)
        if locks:
            own = claim_domain()
            return DomainClaim(domain, own.seat, (*locks, *own.locks))
    if len(domains) == 1:
        who = f"in use by a run without a namespace, or in {namespace}" if namespace else "in use by other runs"
        raise NoFreeDomainError(f"DDS domain {domains[0]} is {who}; end it, or give each run a namespace of its own (--namespace NAME)")
    raise NoFreeDomainError(f"all {len(domains)} DDS domains are in use by other runs on this machine; end some first")


def _lock(domain: int, namespace: str) -> tuple[socket.socket, ...]:
    """Return what holds a domain, alone or with other namespaces; nothing where it is taken.

    The claim is the domain's first RTPS port, but of TCP, on loopback. That of a namespace is the name of a socket besides.
    """
    port, name = socket.socket(socket.AF_INET, socket.SOCK_STREAM), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        if namespace:
            port.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            name.bind(f"\0alula/{domain}{namespace}")
        port.bind(("127.0.0.1", _claim_port(domain)))
        port.listen(1)
    except OSError:
        port.close()
        name.close()
        return ()
    return port, name


def is_claimed(domain: int) -> bool:
    """Return whether a run on this machine holds the domain."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            probe.bind(("127.0.0.1", _claim_port(domain)))
        except OSError:
            return True
    return False


def _claim_port(domain: int) -> int:
    return RTPS_PORT + RTPS_PORTS_PER_DOMAIN * domain
