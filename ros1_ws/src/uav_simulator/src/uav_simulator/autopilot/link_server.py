"""The links of the autopilot, served together: the companion's over TCP and, where wanted, a ground station's over UDP."""

from __future__ import annotations

import select

from uav_simulator.autopilot.endpoint import Endpoint
from uav_simulator.autopilot.tcp_link import TcpLink
from uav_simulator.autopilot.udp_link import UdpLink


class LinkServer:
    """Carries the bytes of the companion's endpoint, and of the ground station's if there is one."""

    def __init__(self, companion: Endpoint, ground: Endpoint | None, *, port: int, gcs_port: int) -> None:
        """``port`` (TCP) and ``gcs_port`` (UDP) on loopback; 0: any free one."""
        tcp = TcpLink(companion, port)
        self.port, self.gcs_port = tcp.port, 0
        self._links: list[TcpLink | UdpLink] = [tcp]
        if ground is not None:
            udp = UdpLink(ground, gcs_port)
            self._links.append(udp)
            self.gcs_port = udp.port

    def serve(self, wait_s: float = 0.0) -> None:
        """Handle what has come, or comes within ``wait_s``, and send what is ready."""
        for link in self._links:
            link.send()
        readable, _, _ = select.select([link.socket for link in self._links], [], [], max(0.0, wait_s))
        for link in self._links:
            if link.socket in readable:
                link.receive()
            link.send()

    def close(self) -> None:
        """Let the clients go and free the ports."""
        for link in self._links:
            link.close()
