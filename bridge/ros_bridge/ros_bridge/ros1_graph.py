"""Read the ROS 1 graph from the master's answer to ``getSystemState``, again only when that is another one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from ros_bridge.graph import Ros1Graph, is_bridge
from ros_bridge.master import Connection, value_of
from ros_bridge.service_types import ServiceTypes


class Ros1Reader:
    """The graph of foreign nodes, as it was last read."""

    def __init__(self, master: Connection, caller_id: str, services: ServiceTypes, selects: Callable[[str], bool]) -> None:
        """``services`` finds out the types of the services whose names ``selects`` selects."""
        self._master = master
        self._caller_id = caller_id
        self._services = services
        self._selects = selects
        self._system = b""
        self.graph = Ros1Graph()

    def read(self, system: bytes) -> bool:
        """Take the master's answer; tell whether the graph is another one than before. Raises OSError."""
        changed = system != self._system
        if changed:
            publishers, subscribers, services = value_of(system, self._master.uri)
            types = {str(name): str(kind) for name, kind in self._master.call("getTopicTypes", self._caller_id)}
            self.graph = Ros1Graph(
                {name: frozenset(nodes) for name, nodes in _foreign(publishers).items()},
                {name: frozenset(nodes) for name, nodes in _foreign(subscribers).items()},
                {name: nodes[0] for name, nodes in _foreign(services).items() if nodes},
                types,
            )
            self._system = system
        known, asked = self._services.look({name: node for name, node in self.graph.services.items() if self._selects(name)})
        with_types = replace(self.graph, service_types=known, services_asked=asked)
        changed = changed or with_types != self.graph
        self.graph = with_types
        return changed


def _foreign(entries: Iterable[Any]) -> dict[str, list[str]]:
    named = {str(name): [str(node) for node in nodes if not is_bridge(str(node))] for name, nodes in entries}
    return {name: nodes for name, nodes in named.items() if nodes}
