"""Ports and DDS domains for parallel runs on one machine, so that they never meet."""

from __future__ import annotations

import fcntl
import os
import socket
import tempfile
from dataclasses import dataclass
from pathlib import Path

# DDS derives its UDP ports from the domain (RTPS 2.5, section 9.6.2.3: 7400 + 250 * domain + ...); above 101 they fall
# into Linux's ephemeral range. 0 is everybody's default and left alone.
DOMAINS = range(1, 102)


class NoFreeDomainError(Exception):
    """All DDS domains are claimed by other runs on this machine."""


def free_port() -> int:
    """Return a TCP port on loopback that nobody listens on at this moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@dataclass(frozen=True)
class DomainClaim:
    """A DDS domain that no other run uses as long as the lock file's descriptor is open (so also not after a crash)."""

    domain: int
    descriptor: int

    def release(self) -> None:
        """Give the domain back."""
        os.close(self.descriptor)


def claim_domain(folder: Path | None = None) -> DomainClaim:
    """Claim the first free domain; the kernel gives it back when the process ends, however it ends.

    Raises:
        NoFreeDomainError: 101 runs hold one each.
    """
    folder = folder or Path(tempfile.gettempdir()) / f"alula-domains-{os.getuid()}"
    folder.mkdir(parents=True, exist_ok=True)
    for domain in DOMAINS:
        descriptor = os.open(folder / str(domain), os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
        else:
            return DomainClaim(domain, descriptor)
    raise NoFreeDomainError(f"all DDS domains {DOMAINS.start} to {DOMAINS.stop - 1} are in use; end some runs first")
