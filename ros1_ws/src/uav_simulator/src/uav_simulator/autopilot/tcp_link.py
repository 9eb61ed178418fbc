"""A TCP server on loopback for one MAVLink client at a time; never blocks."""

from __future__ import annotations

import socket

from uav_simulator.autopilot.endpoint import Endpoint
from uav_simulator.errors import SimulatorError

BUFFER = 65536
OUT_LIMIT = 1_000_000  # bytes that a client may leave unread before it is let go


class TcpLink:
    """Carries an endpoint's bytes; a client that leaves may come back, and finds a fresh link."""

    def __init__(self, endpoint: Endpoint, port: int) -> None:
        self._endpoint = endpoint
        self._client: socket.socket | None = None
        self._unsent = bytearray()
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._server.bind(("127.0.0.1", port))
        except OSError as error:
            self._server.close()
            raise SimulatorError(f"MAVLink port {port} on loopback can't be used: {error.strerror}") from error
        self._server.listen(1)
        self._server.setblocking(False)
        self.port: int = self._server.getsockname()[1]

    @property
    def socket(self) -> socket.socket:
        """The socket to wait for."""
        return self._client or self._server

    def receive(self) -> None:
        """Handle what has come: a client, or its bytes."""
        if self._client is None:
            self._accept()
        self._receive()

    def send(self) -> None:
        """Send what the endpoint has written; what the socket does not take is kept for the next call, up to a limit."""
        out = self._endpoint.take_output()
        if self._client is None:
            return
        self._unsent += out
        try:
            if self._unsent:
                sent = self._client.send(self._unsent)
                del self._unsent[:sent]
        except BlockingIOError:
            pass
        except OSError:
            self._drop()
        if len(self._unsent) > OUT_LIMIT:
            self._drop()

    def close(self) -> None:
        """Let the client go and free the port."""
        self._drop()
        self._server.close()

    def _accept(self) -> None:
        try:
            self._client, _ = self._server.accept()
        except BlockingIOError:
            return
        self._client.setblocking(False)
        self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._endpoint.open_link()

    def _drop(self) -> None:
        if self._client:
            self._client.close()
        self._client = None
        self._unsent.clear()

    def _receive(self) -> None:
        if self._client is None:
            return
        try:
            data = self._client.recv(BUFFER)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._endpoint.feed(data)
        else:
            self._drop()
