"""ROS 1 publishers that misbehave, for tests: they register as they should, then shake hands and send as they are told."""

from __future__ import annotations

import contextlib
import http.client
import socket
import struct
import threading
from collections.abc import Callable
from typing import Any
from xmlrpc.client import ServerProxy, Transport
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

WITHIN_S = 5.0
LENGTH = struct.Struct("<I")
LOOPBACK = "127.0.0.1"


class TimedTransport(Transport):
    """XML-RPC that gives up."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Connect with the time limit."""
        connection = super().make_connection(host)
        connection.timeout = WITHIN_S
        return connection


def master(uri: str) -> Any:
    """Return the master, asked within a time."""
    return ServerProxy(uri, transport=TimedTransport())


class _Quiet(SimpleXMLRPCRequestHandler):
    rpc_paths = ()

    def log_message(self, *arguments: object) -> None:
        """Log nothing; ``http.server`` would write each request to stderr."""


class HostilePublisher:
    """A publisher of a topic whose answer to each subscriber is ``reply`` (its header) and then whatever ``talk`` does with the socket."""

    def __init__(
        self, master_uri: str, topic: str, type_name: str, *, name: str, reply: bytes, talk: Callable[[socket.socket], None]
    ) -> None:
        """Register with the master; subscribers come from here on."""
        self._reply, self._talk = reply, talk
        self._topic, self._name, self._master_uri = topic, name, master_uri
        self.served = threading.Event()
        self._listener = socket.create_server((LOOPBACK, 0))
        self._api = SimpleXMLRPCServer((LOOPBACK, 0), _Quiet, logRequests=False, allow_none=True)
        self._api.register_function(lambda *_: [1, "", ["TCPROS", LOOPBACK, self._listener.getsockname()[1]]], "requestTopic")
        self._uri = f"http://{LOOPBACK}:{self._api.server_address[1]}/"
        threading.Thread(target=self._api.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
        threading.Thread(target=self._serve, daemon=True).start()
        with master(master_uri) as proxy:
            proxy.registerPublisher(name, topic, type_name, self._uri)

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                connection.settimeout(WITHIN_S)
                with connection, contextlib.suppress(OSError):
                    connection.recv(LENGTH.unpack(connection.recv(4, socket.MSG_WAITALL))[0], socket.MSG_WAITALL)
                    connection.sendall(self._reply)
                    self._talk(connection)
                self.served.set()

    def close(self) -> None:
        """Unregister at the master, and close the sockets."""
        with contextlib.suppress(OSError), master(self._master_uri) as proxy:
            proxy.unregisterPublisher(self._name, self._topic, self._uri)
        self._api.shutdown()
        self._api.server_close()
        self._listener.close()


def open_ports(master_uri: str, topic: str) -> list[tuple[str, int]]:
    """Return where the publishers of a topic listen: for XML-RPC and for subscribers."""
    places: list[tuple[str, int]] = []
    with master(master_uri) as proxy:
        published: Any = proxy.getSystemState("/hostile")
        for node in dict(published[2][0]).get(topic, []):
            uri: Any = proxy.lookupNode("/hostile", node)
            with master(uri[2]) as api:
                answer: Any = api.requestTopic("/hostile", topic, [["TCPROS"]])
            host, _, port = uri[2].removeprefix("http://").rstrip("/").rpartition(":")
            places += [(host, int(port)), (answer[2][1], answer[2][2])]
    return places
