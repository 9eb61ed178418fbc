"""The links of the autopilot, served together: the companion's over TCP and, where wanted, a ground station's over UDP."""

from __future__ import annotations

import contextlib
import select
import socket

from uav_simulator.autopilot.endpoint import Endpoint
from uav_simulator.autopilot.tcp_link import TcpLink
from uav_simulator.autopilot.udp_link import UdpLink


class LinkServer:
    """Carries the bytes of the companion's endpoint, and of the ground station's if there is one."""

    def __init__(self, companion: Endpoint, ground: Endpoint | None, *, port: int, gcs_port: int) -> None:
        """``port`` (TCP) and ``gcs_port`` (UDP) on loopback; 0: any free one."""
        self._woken, self._waker = socket.socketpair()
        self._woken.setblocking(False)
        self._waker.setblocking(False)
        tcp = TcpLink(companion, port)
        self.port, self.gcs_port = tcp.port, 0
        self._links: list[TcpLink | UdpLink] = [tcp]
        if ground is not None:
            udp = UdpLink(ground, gcs_port)
            self._links.append(udp)
            self.gcs_port = udp.port

    def serve(self, wait_s: float = 0.0) -> None:
        """Handle what has come, or comes within ``wait_s`` seconds, and send what is ready."""
        for link in self._links:
            link.send()
        readable, _, _ = select.select([self._woken, *(link.socket for link in self._links)], [], [], max(0.0, wait_s))
        if self._woken in readable:
            self._woken.recv(4096)
        for link in self._links:
            if link.socket in readable:
                link.receive()
            link.send()

    def wake(self) -> None:
        """End the wait of ``serve``, or of its next call; may be called from any thread."""
        with contextlib.suppress(OSError):  # full of such words already, or closed
            self._waker.send(b"\0")

    def close(self) -> None:
        """Let the clients go and free the ports."""
        self._woken.close()
        self._waker.close()
        for link in self._links:
            link.close()
