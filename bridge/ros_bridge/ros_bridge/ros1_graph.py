"""Read the ROS 1 graph from the master, cheaply: one request on a kept connection, and nothing more while the answer is the same."""

from __future__ import annotations

import http.client
from collections.abc import Callable, Iterable, Mapping
from typing import Any, cast
from urllib.parse import urlsplit
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import dumps, loads

from ros_bridge.graph import Ros1Graph, is_bridge

ANSWER_WITHIN_S = 2.0
HEADERS = {"Content-Type": "text/xml", "Connection": "keep-alive"}
Entries = list[tuple[str, list[str]]]


class MasterUnreachableError(Exception):
    """The master does not answer."""


class MasterClient:
    """XML-RPC to the master over one connection that is kept; for one thread."""

    def __init__(self, uri: str, caller_id: str) -> None:
        parts = urlsplit(uri)
        self._connection = http.client.HTTPConnection(parts.hostname or "localhost", parts.port or 11311, timeout=ANSWER_WITHIN_S)
        self._caller_id = caller_id

    def ask_raw(self, method: str, *arguments: str) -> bytes:
        """Call a method of the master API and return the answer's text; raises MasterUnreachableError."""
        body = dumps((self._caller_id, *arguments), method)
        for attempt in (1, 2):  # a kept connection may have been closed meanwhile
            try:
                self._connection.request("POST", "/RPC2", body, HEADERS)
                return self._connection.getresponse().read()
            except (OSError, http.client.HTTPException) as error:
                self._connection.close()
                if attempt == 2:
                    raise MasterUnreachableError(str(error)) from error
        raise AssertionError

    def ask(self, method: str, *arguments: str) -> Any:
        """Call a method and return its value; raises MasterUnreachableError."""
        return value_of(self.ask_raw(method, *arguments))

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def value_of(answer: bytes) -> Any:
    """Return the value in a master's answer ``[code, message, value]``; raises MasterUnreachableError when it is none."""
    try:
        return cast("Any", loads(answer)[0][0])[2]
    except (XmlRpcError, ValueError, IndexError, TypeError, SyntaxError) as error:
        raise MasterUnreachableError(f"the answer can't be read: {error}") from error


class Ros1Reader:
    """The graph, read again only when the master's state has changed."""

    def __init__(self, client: MasterClient, service_type: Callable[[str, str], str | None]) -> None:
        """``service_type`` asks the node (its URI) of a service for the type."""
        self._client = client
        self._service_type = service_type
        self._state = b""
        self._known: dict[tuple[str, str], str | None] = {}
        self._graph = Ros1Graph()

    def read(self) -> Ros1Graph:
        """Return the graph of foreign nodes; the very same object while nothing has changed. Raises MasterUnreachableError."""
        state = self._client.ask_raw("getSystemState")
        if state != self._state:
            publishers, subscribers, services = value_of(state)
            types = {str(name): str(kind) for name, kind in self._client.ask("getTopicTypes")}
            providers = {name: nodes[0] for name, nodes in _foreign(services).items() if nodes}
            self._graph = Ros1Graph(
                {name: frozenset(nodes) for name, nodes in _foreign(publishers).items()},
                {name: frozenset(nodes) for name, nodes in _foreign(subscribers).items()},
                providers,
                types,
                self._service_types(providers),
            )
            self._state = state
        return self._graph

    def _service_types(self, providers: Mapping[str, str]) -> dict[str, str]:
        self._known = {key: kind for key, kind in self._known.items() if key[1] == providers.get(key[0])}
        for key in providers.items():
            if self._known.get(key) is None:
                self._known[key] = self._service_type(key[0], str(self._client.ask("lookupService", key[0])))
        return {name: kind for (name, _), kind in self._known.items() if kind is not None}


def _foreign(entries: Iterable[Any]) -> dict[str, list[str]]:
    named = {str(name): [str(node) for node in nodes if not is_bridge(str(node))] for name, nodes in entries}
    return {name: nodes for name, nodes in named.items() if nodes}
