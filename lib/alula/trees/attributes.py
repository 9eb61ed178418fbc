"""The attributes of a node in a file: its type and its name, ports, conditions."""

from __future__ import annotations

from alula.trees.document import Element
from alula.trees.node_type import CATEGORIES

PRECONDITIONS = ("_failureIf", "_successIf", "_skipIf", "_while")
POSTCONDITIONS = ("_onHalted", "_onFailure", "_onSuccess", "_post")
AUTOREMAP = "_autoremap"
RESERVED = frozenset({"name", "ID", AUTOREMAP, *PRECONDITIONS, *POSTCONDITIONS})


def is_port(attribute: str) -> bool:
    """Return whether an attribute of a node is a port: others are its name, conditions, or what an editor has noted (``_uid``)."""
    return attribute[0].isalpha() and attribute not in RESERVED


def type_name(element: Element) -> str:
    """Return the name of a node's type: the tag, or the ID of ``<Action ID=...>`` and its like."""
    return element.get("ID") if element.tag in CATEGORIES else element.tag


def node_name(element: Element) -> str:
    """Return the name of a node: that of its type unless it has one of its own."""
    return element.get("name") or type_name(element)
