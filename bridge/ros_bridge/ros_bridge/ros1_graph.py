"""Read the ROS 1 graph from the master's answer to ``getSystemState``, again only when that is another one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ros_bridge.graph import Ros1Graph, is_bridge
from ros_bridge.master import Connection, value_of


class Ros1Reader:
    """The graph of foreign nodes, as it was last read."""

    def __init__(self, master: Connection, caller_id: str, service_type: Callable[[str, str], str | None]) -> None:
        """``service_type`` asks the node (its URI) of a service for the type."""
        self._master = master
        self._caller_id = caller_id
        self._service_type = service_type
        self._system = b""
        self._known: dict[tuple[str, str], str | None] = {}
        self.graph = Ros1Graph()

    def read(self, system: bytes) -> bool:
        """Take the master's answer; tell whether it was another one. Raises OSError."""
        if system == self._system:
            return False
        publishers, subscribers, services = value_of(system, self._master.uri)
        types = {str(name): str(kind) for name, kind in self._master.call("getTopicTypes", self._caller_id)}
        providers = {name: nodes[0] for name, nodes in _foreign(services).items() if nodes}
        self.graph = Ros1Graph(
            {name: frozenset(nodes) for name, nodes in _foreign(publishers).items()},
            {name: frozenset(nodes) for name, nodes in _foreign(subscribers).items()},
            providers,
            types,
            self._service_types(providers),
        )
        self._system = system
        return True

    def _service_types(self, providers: Mapping[str, str]) -> dict[str, str]:
        self._known = {key: kind for key, kind in self._known.items() if key[1] == providers.get(key[0])}
        for key in providers.items():
            if self._known.get(key) is None:
                self._known[key] = self._service_type(key[0], str(self._master.call("lookupService", self._caller_id, key[0])))
        return {name: kind for (name, _), kind in self._known.items() if kind is not None}


def _foreign(entries: Iterable[Any]) -> dict[str, list[str]]:
    named = {str(name): [str(node) for node in nodes if not is_bridge(str(node))] for name, nodes in entries}
    return {name: nodes for name, nodes in named.items() if nodes}
