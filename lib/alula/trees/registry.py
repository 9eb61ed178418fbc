"""The types of node that a tree may have, by their names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from alula.trees.node_type import NodeClass, NodeType


class NodeRegistry:
    """Types of node by their names."""

    def __init__(self, types: Iterable[NodeType] = ()) -> None:
        self._types: dict[str, NodeType] = {}
        for one in types:
            self.add(one)

    def add(self, one: NodeType) -> None:
        """Add a type; a name is given once only, unless the one before was known from a model only."""
        known = self._types.get(one.name)
        if known is not None and known.is_tickable:
            msg = f"the node {one.name} is registered already"
            raise ValueError(msg)
        self._types[one.name] = one

    def register(self, node: NodeClass, name: str = "") -> NodeType:
        """Add a class of one's own, whose ports are what it declares, under a name: as it was registered unless another is given."""
        one = node.as_type(name)
        self.add(one)
        return one

    def get(self, name: str) -> NodeType | None:
        """Return a type, None where there is none of that name."""
        return self._types.get(name)

    def names(self) -> list[str]:
        """Return all names."""
        return list(self._types)

    def __iter__(self) -> Iterator[NodeType]:
        return iter(self._types.values())

    def __or__(self, other: NodeRegistry) -> NodeRegistry:
        """Return one with the types of both."""
        return NodeRegistry([*self, *other])
