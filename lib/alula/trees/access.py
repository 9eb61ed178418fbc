"""What a node reads and writes: the scripts that its element holds, and the entries that its ports name.

The check of files and the search of all runs both read it here. What is in a script, its `Program` tells.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from alula.trees.document import Attribute, Element
from alula.trees.node import Node, pointer
from alula.trees.palette import Direction, NodeType
from alula.trees.reading import POSTCONDITIONS, PRECONDITIONS


def scripts_before(element: Element) -> Iterator[Attribute]:
    """Yield the attributes whose scripts run before the node is ticked."""
    return _present(element, PRECONDITIONS)


def scripts_within(element: Element, type_: NodeType | None) -> Iterator[Attribute]:
    """Yield the attributes whose scripts are the node's own; not those that name an entry, and not the empty ones that do nothing."""
    for attribute in _present(element, () if type_ is None else type_.scripts):
        may_be_empty = type_ is not None and type_.ports[attribute.name].may_be_empty
        if not _is_in_entry(attribute) and (attribute.value or not may_be_empty):
            yield attribute


def scripts_after(element: Element) -> Iterator[Attribute]:
    """Yield the attributes whose scripts run after the node has ended."""
    return _present(element, POSTCONDITIONS)


def scripts_of(element: Element, type_: NodeType | None) -> Iterator[Attribute]:
    """Yield the attributes with scripts, in the order in which these run; ``type_`` is None for a subtree and an unknown node."""
    yield from scripts_before(element)
    yield from scripts_within(element, type_)
    yield from scripts_after(element)


def takes_script_from_entry(element: Element, type_: NodeType | None) -> bool:
    """Tell whether a node runs a script that an entry holds: it may read and write anything."""
    return any(_is_in_entry(attribute) for attribute in _present(element, () if type_ is None else type_.scripts))


def named_entries(node: Node) -> Mapping[str, str]:
    """Return the entries that a node's ports name, by port, as the file calls them: ``@entry`` is one of the main tree."""
    keys = ((port, pointer(text, port)) for port, text in node.wiring.ports.items())
    return {port: key for port, key in keys if key is not None}


def written_entries(node: Node) -> Mapping[str, str]:
    """Return the entries that a node may write through its ports, by port; as `named_entries`."""
    known = node.wiring.type.ports
    return {port: key for port, key in named_entries(node).items() if port in known and known[port].direction is not Direction.INPUT}


def _is_in_entry(attribute: Attribute) -> bool:
    return attribute.value.lstrip().startswith("{")


def _present(element: Element, names: tuple[str, ...]) -> Iterator[Attribute]:
    return (element.attributes[name] for name in names if name in element.attributes)
