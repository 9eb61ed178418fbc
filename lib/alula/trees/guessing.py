"""Guesses types of node that nobody has declared from how trees use them: a first list, for a person to edit."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from alula.trees.attributes import is_port, type_name
from alula.trees.document import Element
from alula.trees.node import pointer
from alula.trees.node_type import CATEGORIES, Category, NodeType, node_type
from alula.trees.ports import Direction, Port
from alula.trees.registry import NodeRegistry
from alula.trees.values import ANY, BOOL, DOUBLE, INT, STRING, PortType

ASKING = re.compile(r"(?:Is|Are|Has|Have|Can|Check|Was|Should)(?=[A-Z_\d])")
"""How the names of conditions begin."""
TOLD = re.compile(r"(?:out|output|result|return)(?:_|$|put)", re.IGNORECASE)
"""How the names of outputs begin."""
LITERALS: Sequence[tuple[PortType, re.Pattern[str]]] = (
    (BOOL, re.compile(r"(?i)true|false")),
    (INT, re.compile(r"[-+]?\d{1,9}")),
    (DOUBLE, re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")),
)


def category_of(name: str, uses: Collection[Element]) -> Category:
    """Return what the uses of a node show it to be: what their tag says, else what fits the number of their children."""
    tag = next((use.tag for use in uses if use.tag in CATEGORIES), "")
    most = max(len(use.children) for use in uses)
    if tag:
        return CATEGORIES[tag]
    leaf = Category.CONDITION if ASKING.match(name) else Category.ACTION
    return (leaf, Category.DECORATOR)[most] if most < 2 else Category.CONTROL


def guessed_types(trees: Iterable[Element], known: NodeRegistry) -> list[NodeType]:
    """Return the types of all nodes of trees that are not known, in the order of their names, each with where it was guessed from."""
    places = [_Entries.of(tree, known) for tree in trees]
    uses: dict[str, list[tuple[Element, _Entries]]] = {}
    for entries in places:
        for element in entries.elements:
            if known.get(type_name(element)) is None and element.tag != Category.SUBTREE.value and type_name(element):
                uses.setdefault(type_name(element), []).append((element, entries))
    return [_guessed(name, found) for name, found in sorted(uses.items())]


@dataclass(frozen=True)
class _Entries:
    """Who names the entries of a tree: for each entry the elements with their ports, in the order of the file."""

    elements: Sequence[Element]
    users: Mapping[str, Sequence[tuple[Element, str]]]
    known: NodeRegistry

    @classmethod
    def of(cls, tree: Element, known: NodeRegistry) -> _Entries:
        elements = [one for top in tree.children for one in top.iterate()]
        users: dict[str, list[tuple[Element, str]]] = {}
        for element in elements:
            for attribute in element.attributes.values():
                key = pointer(attribute.value, attribute.name) if is_port(attribute.name) else None
                if key is not None:
                    users.setdefault(key, []).append((element, attribute.name))
        return cls(elements, users, known)

    def port(self, element: Element, name: str) -> Port | None:
        """Return what is known of a port."""
        known = self.known.get(type_name(element)) if element.tag != Category.SUBTREE.value else None
        return known.ports.get(name) if known else None

    def type_of(self, key: str) -> PortType:
        """Return the type that a known port gives an entry."""
        types = [port.type for element, name in self.users[key] if (port := self.port(element, name)) is not None]
        return next((one for one in types if one is not ANY), ANY)

    def is_written_first(self, key: str, element: Element) -> bool:
        """Return whether an element is the first to name an entry, others name it later, and none of them is known to write it."""
        users = self.users[key]
        ports = [self.port(one, name) for one, name in users]
        is_known = any(port is not None and port.direction is not Direction.INPUT for port in ports)
        return users[0][0] is element and len({id(one) for one, _ in users}) > 1 and not is_known


def _guessed(name: str, uses: Sequence[tuple[Element, _Entries]]) -> NodeType:
    names = dict.fromkeys(attribute for element, _ in uses for attribute in element.attributes if is_port(attribute))
    first = uses[0][0].place
    doc = f"guessed from {len(uses)} use{'s' if uses[1:] else ''}, first {first}"
    return node_type(name, category_of(name, [element for element, _ in uses]), [_port(port, uses) for port in names], doc=doc)


def _port(name: str, uses: Sequence[tuple[Element, _Entries]]) -> Port:
    given = [(element.get(name), element, entries) for element, entries in uses if name in element.attributes]
    keys = [(pointer(value, name), element, entries) for value, element, entries in given]
    literals = [value for (value, _, _), (key, _, _) in zip(given, keys, strict=True) if key is None]
    named = [(key, element, entries) for key, element, entries in keys if key is not None]
    is_told = TOLD.match(name) is not None or any(entries.is_written_first(key, element) for key, element, entries in named)
    direction = Direction.OUTPUT if is_told and not literals else Direction.INPUT
    if literals:
        return Port(name, _type_of(literals), direction)
    return Port(name, next((one for key, _, entries in named if (one := entries.type_of(key)) is not ANY), ANY), direction)


def _type_of(literals: Sequence[str]) -> PortType:
    return next((kind for kind, pattern in LITERALS if all(pattern.fullmatch(one.strip()) for one in literals)), STRING)
