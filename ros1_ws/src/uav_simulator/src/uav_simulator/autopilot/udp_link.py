"""A UDP port on loopback for one MAVLink peer, as a ground station behind a radio is: the last sender is answered; never blocks."""

from __future__ import annotations

import contextlib
import socket

from uav_simulator.autopilot.endpoint import Endpoint
from uav_simulator.errors import SimulatorError

BUFFER = 65536
DATAGRAM = 1200  # bytes of MAVLink in one, whole messages or not: the peer's parser does not mind


class UdpLink:
    """Carries an endpoint's bytes; what is sent before the first datagram came is lost."""

    def __init__(self, endpoint: Endpoint, port: int) -> None:
        self._endpoint = endpoint
        self._peer: tuple[str, int] | None = None
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.bind(("127.0.0.1", port))
        except OSError as error:
            self.socket.close()
            raise SimulatorError(f"UDP port {port} on loopback can't be used: {error.strerror}") from error
        self.socket.setblocking(False)
        self.port: int = self.socket.getsockname()[1]

    def receive(self) -> None:
        """Give the endpoint all datagrams that have come, and take their sender as the peer."""
        # A peer that has gone makes the next call fail (ICMP port unreachable); the link goes on.
        with contextlib.suppress(BlockingIOError, ConnectionError):
            while True:
                data, self._peer = self.socket.recvfrom(BUFFER)
                self._endpoint.feed(data)

    def send(self) -> None:
        """Send what the endpoint has written to the last peer; without a peer it is lost."""
        out = self._endpoint.take_output()
        if self._peer is None:
            return
        with contextlib.suppress(BlockingIOError, ConnectionError):
            for start in range(0, len(out), DATAGRAM):
                self.socket.sendto(out[start : start + DATAGRAM], self._peer)

    def close(self) -> None:
        """Close the socket."""
        self.socket.close()
