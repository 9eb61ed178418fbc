"""A tree at one moment, for drawings, pages and records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from alula.trees.attributes import POSTCONDITIONS, PRECONDITIONS
from alula.trees.node import Node
from alula.trees.node_type import Category

CATEGORIES: Mapping[Category, str] = {
    Category.ACTION: "action",
    Category.CONDITION: "condition",
    Category.CONTROL: "control",
    Category.DECORATOR: "decorator",
    Category.SUBTREE: "subtree",
}


@dataclass(frozen=True)
class Source:
    """What the file says of a node: its type, its ports and conditions as text, and where it stands, as ``mapping.xml:12``."""

    type: str
    ports: Mapping[str, str]
    conditions: Mapping[str, str]
    place: str

    def as_dict(self) -> dict[str, object]:
        """Return what is written as JSON."""
        return {"type": self.type, "ports": dict(self.ports), "conditions": dict(self.conditions), "place": self.place}


@dataclass(frozen=True)
class NodeView:
    """A node at one moment; ``status`` is the last one that said something: a node that is left keeps it.

    ``source`` is None for a node that stands in no file.
    """

    name: str
    kind: str
    status: str
    message: str
    skill: str
    children: tuple[NodeView, ...]
    source: Source | None = field(default=None)

    def as_dict(self) -> dict[str, object]:
        """Return what is written as JSON."""
        return {
            "name": self.name,
            "kind": self.kind,
            "status": self.status,
            "message": self.message,
            "skill": self.skill,
            **({} if self.source is None else self.source.as_dict()),
            "children": [child.as_dict() for child in self.children],
        }

    def walk(self) -> Iterator[NodeView]:
        """Yield this node and all below, top to bottom."""
        yield self
        for child in self.children:
            yield from child.walk()


def kind_of(node: Node) -> str:
    """Return what a node is, in the words of the figures."""
    if skill_of(node):
        return "skill"
    return node.known_ticking().figure or CATEGORIES[node.config.type.category]


def skill_of(node: Node) -> str:
    """Return the skill that a leaf runs, as navigation.goto; empty where it is none: a robot's own node is a class, as uav.NextWaypoint."""
    kind = node.config.type
    _, dot, name = kind.name.rpartition(".")
    return kind.name if kind.category is Category.ACTION and dot and name[:1].islower() else ""


def conditions_of(node: Node) -> dict[str, str]:
    """Return the pre- and postconditions of a node as its file has them."""
    element = node.config.element
    return {name: element.get(name) for name in (*PRECONDITIONS, *POSTCONDITIONS) if name in element.attributes}


def source_of(node: Node) -> Source:
    """Return what the file says of a node, without what it leaves to a default."""
    element, place = node.config.element, node.config.element.place
    ports = {name: text for name, text in node.config.ports.items() if name in element.attributes}
    type_ = element.get("ID") if node.config.type.category is Category.SUBTREE else node.config.type.name
    return Source(type_, ports, conditions_of(node), f"{Path(place.path).name}:{place.line}")


def view_of(node: Node) -> NodeView:
    """Return a tree as its file has it and as its nodes are now."""
    children = tuple(map(view_of, node.children))
    return NodeView(node.name, kind_of(node), node.status.value, "", skill_of(node), children, source_of(node))
