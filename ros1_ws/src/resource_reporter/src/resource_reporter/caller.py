"""A call of a service that never takes longer than it may, and never comes later: rospy's own has no time limit.

What was given up is not asked for any more when a network that was away comes back: where nothing was sent yet, nothing will be, and what
waits to be sent again is dropped with its connection, which is reset.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from dataclasses import dataclass, field
from typing import Any

import rospy
from rospy.impl.tcpros_base import TCPROSTransport

CALL_LIMIT_S = 2.0
CONNECT_LIMIT_S = 1.5
"""So long may a connection take. In a cut the kernel tries later and later again: one that is begun anew stands soon after its end."""
MOST_ABANDONED = 4
RESET = struct.pack("ii", 1, 0)
"""Of SO_LINGER: a close drops what was not acknowledged."""


class CallFailedError(RuntimeError):
    """The service is not there, broke off, or did not answer in time."""


@dataclass
class _Attempt:
    """One call in a thread of its own, which may be abandoned."""

    done: threading.Event = field(default_factory=threading.Event)
    response: Any = None
    error: str = ""
    abandoned: bool = False


class ServiceCaller:
    """Call a service over a kept connection (no look-up at the master: about 1 ms), renewed when it broke; from one thread at a time."""

    def __init__(self, name: str, kind: Any) -> None:
        self.name = name
        self._kind = kind
        self._proxy: rospy.ServiceProxy | None = None
        self._lock = threading.Lock()
        self._abandoned: list[threading.Thread] = []

    def call(self, request: Any, *, limit_s: float = CALL_LIMIT_S) -> Any:
        """Return the answer; CallFailedError after ``limit_s`` (wall clock) at the latest."""
        self._abandoned = [thread for thread in self._abandoned if thread.is_alive()]
        if len(self._abandoned) >= MOST_ABANDONED:
            self._abandoned[0].join(limit_s)
            raise CallFailedError(f"{self.name} does not answer")
        attempt = _Attempt()
        thread = threading.Thread(target=self._run, args=(request, attempt), daemon=True)
        thread.start()
        if not attempt.done.wait(limit_s):
            with self._lock:
                attempt.abandoned = True
            self.close()
            self._abandoned.append(thread)
            raise CallFailedError(f"{self.name} did not answer within {limit_s:.3g} s")
        if attempt.response is None:
            self.close()
            raise CallFailedError(attempt.error)
        return attempt.response

    def close(self) -> None:
        """Drop the connection; a thread that waits on it ends."""
        proxy, self._proxy = self._proxy, None
        if proxy is not None:
            _drop(proxy)

    def _run(self, request: Any, attempt: _Attempt) -> None:
        try:
            proxy = self._proxy or self._connected(request)
            with self._lock:
                if attempt.abandoned:
                    _drop(proxy)
                    return
                self._proxy = proxy
            attempt.response = proxy(request)
        except Exception as error:  # noqa: BLE001  # rospy lets through all that the sockets below it raise
            attempt.error = f"{self.name}: {error}"
        finally:
            attempt.done.set()

    def _connected(self, request: Any) -> rospy.ServiceProxy:
        """Return a proxy that is connected, as its own call would make it, before anything is sent."""
        proxy = rospy.ServiceProxy(self.name, self._kind, persistent=True)
        uri = proxy._get_service_uri(request)  # noqa: SLF001
        transport = TCPROSTransport(proxy.protocol, proxy.resolved_name)
        transport.buff_size = proxy.buff_size
        try:
            transport.connect(*rospy.core.parse_rosrpc_uri(uri), uri, timeout=CONNECT_LIMIT_S)
            transport.socket.settimeout(None)
        except rospy.exceptions.TransportInitError as error:
            raise rospy.ServiceException(f"unable to connect to service: {error}") from error
        proxy.transport = transport
        return proxy


def _drop(proxy: rospy.ServiceProxy) -> None:
    """End a proxy's connection, and what of it is under way; a thread that waits on it ends."""
    transport = proxy.transport
    connection = None if transport is None else transport.socket
    if connection is not None:
        with contextlib.suppress(OSError):
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
            connection.shutdown(socket.SHUT_RD)  # wakes who reads, and sends nothing
        connection.close()  # before the transport, which would first end it in order
        transport.close()
