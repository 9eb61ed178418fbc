"""Tell systemd how a service is, where systemd has started it (sd_notify(3))."""

from __future__ import annotations

import contextlib
import os
import socket

VARIABLE = "NOTIFY_SOCKET"


def notify(what: str) -> None:
    """Send a state such as ``READY=1``; nothing where nobody listens. A message that gets lost is followed by another one."""
    address = os.environ.get(VARIABLE, "")
    if not address:
        return
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as to:
        to.connect(f"\0{address[1:]}" if address.startswith("@") else address)
        to.send(what.encode())
