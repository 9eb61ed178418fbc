"""Calls of ROS 1 services as bytes, each within a time: the client half of TCPROS services.

rospy's own proxy waits for an answer without end, so this speaks the protocol itself (ROS wiki, "ROS/TCPROS"): a header both ways,
then for each call a length and the request; back comes one byte, 1 for an answer or 0 for an error text, a length, the payload.
"""

from __future__ import annotations

import contextlib
import http.client
import select
import socket
import struct
import threading
import time
from dataclasses import dataclass
from io import BytesIO
from typing import Any
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import ServerProxy, Transport

from ros_bridge import two_worlds
from ros_bridge.errors import CallError, CallTimeoutError

two_worlds.import_ros1()

import rosgraph.network  # noqa: E402 - only after ROS 1 is there

HEADER_BYTES = 4096
REUSE_WITHIN_S = 2.0  # after that the master is asked again: the service may have moved to another node
POLL_S = 0.05
NO_SUCH_SERVICE = -1


class TimedTransport(Transport):
    """XML-RPC that gives up."""

    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Connect with the time limit."""
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


@dataclass(frozen=True)
class Deadline:
    """A moment on the steady clock."""

    end_s: float

    @classmethod
    def after(cls, timeout_s: float) -> Deadline:
        """Return the deadline that is so many seconds away."""
        return cls(time.monotonic() + timeout_s)

    def remaining_s(self, what: str) -> float:
        """Return the time left, above zero; raises CallTimeoutError, naming what was waited for, when there is none."""
        remaining_s = self.end_s - time.monotonic()
        if remaining_s <= 0:
            raise CallTimeoutError(f"timed out: {what}")
        return remaining_s


class Ros1Connection:
    """A connection to a service's server, used by one call at a time."""

    def __init__(self, address: tuple[str, int], header: dict[str, str], deadline: Deadline) -> None:
        """Connect and shake hands; raises OSError or CallError."""
        what = f"no connection to the server at {address[0]}:{address[1]}"
        self._socket = socket.create_connection(address, timeout=deadline.remaining_s(what))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.used_s = time.monotonic()
        try:
            rosgraph.network.write_ros_handshake_header(self._socket, header)
            answer = rosgraph.network.read_ros_handshake_header(self._socket, BytesIO(), HEADER_BYTES)
        except (OSError, rosgraph.network.ROSHandshakeException) as error:
            self.close()
            raise CallError(f"{what}: {error}") from error
        if "error" in answer:
            self.close()
            raise CallError(f"the server refuses the connection: {answer['error']}")

    def usable(self) -> bool:
        """Tell whether the connection was used lately and the server has not closed it."""
        if time.monotonic() - self.used_s > REUSE_WITHIN_S:
            return False
        readable, _, _ = select.select([self._socket], [], [], 0)
        return not readable  # between calls there is nothing to read but the end

    def call(self, request: bytes | memoryview, deadline: Deadline) -> bytes:
        """Send a request and return the answer; raises CallError. After an error the connection must be closed."""
        try:
            self._socket.settimeout(deadline.remaining_s("the request could not be sent"))
            self._socket.sendall(struct.pack("<I", len(request)) + request)
            ok, length = struct.unpack("<BI", self._receive(5, deadline))
            payload = self._receive(length, deadline)
        except TimeoutError as error:
            raise CallTimeoutError("timed out: the server has not answered") from error
        except OSError as error:
            raise CallError(f"the server broke the connection in the call: {error}") from error
        self.used_s = time.monotonic()
        if not ok:
            raise CallError(payload.decode(errors="replace"))
        return payload

    def _receive(self, length: int, deadline: Deadline) -> bytes:
        received = bytearray()
        while len(received) < length:
            self._socket.settimeout(deadline.remaining_s("the server has not answered"))
            part = self._socket.recv(min(length - len(received), 1 << 20))
            if not part:
                raise CallError("the server ended in the call")
            received += part
        return bytes(received)

    def close(self) -> None:
        """Close the socket; a call in another thread ends with an error."""
        with contextlib.suppress(OSError):  # the other side was faster
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


class Ros1Service:
    """A service in ROS 1, found by the master, called over connections that are kept for the next call."""

    def __init__(self, name: str, md5sum: str, *, master_uri: str, caller_id: str) -> None:
        """Remember whom to call; nothing is connected yet."""
        self._name = name
        self._master_uri = master_uri
        self._header = {"service": name, "md5sum": md5sum, "callerid": caller_id, "persistent": "1"}
        self._lock = threading.Lock()
        self._idle: list[Ros1Connection] = []
        self._open: set[Ros1Connection] = set()
        self._closed = threading.Event()

    def call(self, request: bytes | memoryview, deadline: Deadline) -> bytes:
        """Call the service, waiting for its server if need be, and return the answer's bytes.

        A request is sent once: whether a server that died in a call had carried it out nobody knows, so it is not repeated.

        Raises:
            CallError: The server refused, raised, or died.
            CallTimeoutError: There was no server or no answer in time.
        """
        connection = self._take_idle() or self._connect(deadline)
        try:
            answer = connection.call(request, deadline)
        except CallError:
            self._discard(connection)
            raise
        with self._lock:
            self._idle.append(connection)
        return answer

    def _take_idle(self) -> Ros1Connection | None:
        while True:
            with self._lock:
                if not self._idle:
                    return None
                connection = self._idle.pop()
            if connection.usable():
                return connection
            self._discard(connection)

    def _connect(self, deadline: Deadline) -> Ros1Connection:
        problem = "the ROS master has not answered, asked"
        while not self._closed.is_set():
            try:
                address = self._look_up(deadline.remaining_s(f"{problem} for {self._name} in ROS 1"))
                problem = "no server"
                if address is not None:
                    connection = Ros1Connection(address, self._header, deadline)
                    with self._lock:
                        self._open.add(connection)
                    return connection
            except (OSError, XmlRpcError, http.client.HTTPException) as error:
                problem = f"no server can be reached: {error}"
            self._closed.wait(min(POLL_S, deadline.remaining_s(f"{problem} for {self._name} in ROS 1")))
        raise CallError("the bridge is shutting down")

    def _look_up(self, timeout_s: float) -> tuple[str, int] | None:
        """Ask the master where the server is; None when it knows none."""
        with ServerProxy(self._master_uri, transport=TimedTransport(timeout_s)) as master:
            answer: Any = master.lookupService(self._header["callerid"], self._name)
        code, _, uri = answer
        if code == NO_SUCH_SERVICE:
            return None
        host, _, port = str(uri).removeprefix("rosrpc://").rstrip("/").rpartition(":")
        return host, int(port)

    def _discard(self, connection: Ros1Connection) -> None:
        connection.close()
        with self._lock:
            self._open.discard(connection)

    def close(self) -> None:
        """End all connections; calls under way end with an error."""
        self._closed.set()
        with self._lock:
            connections = list(self._open)
        for connection in connections:
            self._discard(connection)
