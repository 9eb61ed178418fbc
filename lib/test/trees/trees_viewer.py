"""A viewer of Groot2's protocol, as plain as can be."""

from __future__ import annotations

import struct

import zmq

from alula.trees.groot.address import Address

TIMEOUT_MS = 20_000


class Viewer:
    def __init__(self, address: Address) -> None:
        self.socket = zmq.Context.instance().socket(zmq.REQ)
        self.socket.setsockopt(zmq.RCVTIMEO, TIMEOUT_MS)
        self.socket.setsockopt(zmq.LINGER, 0)
        self.socket.connect(f"tcp://{address.host}:{address.port}")

    def raw(self, *parts: bytes) -> list[bytes]:
        self.socket.send_multipart(parts)
        return self.socket.recv_multipart()

    def ask(self, request: str, *more: bytes) -> list[bytes]:
        return self.raw(struct.pack("<BBI", 2, ord(request), 77), *more)
