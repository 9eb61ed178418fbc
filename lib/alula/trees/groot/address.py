"""Where viewers find a tree; needs no ZeroMQ."""

from __future__ import annotations

import socket
from dataclasses import dataclass

from alula.common.errors import AlulaError
from alula.common.network import free_port
from alula.trees.groot.protocol import DEFAULT_PORT

LOOPBACK = "127.0.0.1"
LAST_PORT = 65535
PORTS_IN_A_ROW = 2
"""Replies and what is published, as Groot2's protocol has it."""


class ServerError(AlulaError):
    """The tree can't be served; the message names the address and the remedy."""


@dataclass(frozen=True)
class Address:
    """Where viewers find the server; port 0: any that is free."""

    host: str = LOOPBACK
    port: int = DEFAULT_PORT

    @classmethod
    def read(cls, text: str) -> Address:
        """Read ``[HOST:]PORT``, nothing is the default; raises ServerError."""
        host, _, port = text.rpartition(":")
        if not text:
            return cls()
        if not port.isdecimal() or not 0 <= int(port) < LAST_PORT:
            raise ServerError(f"'{text}' is no [HOST:]PORT: the port is a number from 1 to {LAST_PORT - 1}, as 1667")
        return cls(host or LOOPBACK, int(port))

    def looked_up(self) -> Address:
        """Return it in numbers, with a port, both ports of which are free at this moment; raises ServerError."""
        port = self.port or free_port(PORTS_IN_A_ROW)
        try:
            host = socket.gethostbyname(self.host)
            for one in range(port, port + PORTS_IN_A_ROW):
                with socket.socket() as probe:
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as ZeroMQ does
                    probe.bind((host, one))
        except OSError as error:
            raise taken(Address(self.host, port), error.strerror or str(error)) from None
        return Address(host, port)

    def __str__(self) -> str:
        """Return it as `read` reads it."""
        return f"{self.host}:{self.port}"


def taken(address: Address, why: str) -> ServerError:
    """Return what is to be raised where the ports can't be had."""
    return ServerError(f"the tree can't be shown on {address.host}, ports {address.port} and {address.port + 1}: {why}; choose others")
