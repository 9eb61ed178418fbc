"""Trees and types of node as BehaviorTree.CPP 4 writes them for its viewers: `tree_xml` with nodes' ``_uid``, `model_xml` types alone.

Source: BehaviorTree.CPP 4.8.2, ``xml_parsing.cpp`` (``WriteTreeToXML``, ``writeTreeNodesModelXML``).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from xml.etree.ElementTree import Element, SubElement
from xml.sax.saxutils import escape

from alula.trees.node import Node
from alula.trees.node_type import Category, NodeType
from alula.trees.standard import standard_registry
from alula.trees.tree import Subtree, Tree
from alula.trees.view import conditions_of

NO_PORTS = {"ID", "name"}
INDENT = "    "
_QUOTED = {'"': "&quot;", "'": "&apos;"}


def tree_xml(tree: Tree) -> str:
    """Return each subtree by itself, and the model of its types of node and of BehaviorTree.CPP's own."""
    root = _root()
    for subtree in tree.subtrees:
        body = SubElement(root, "BehaviorTree", {"ID": subtree.tree_id, "_fullpath": subtree.path})
        _add_node(body, subtree.nodes[0], subtree)
    types = {one.name: one for one in standard_registry()} | {node.config.type.name: node.config.type for node in tree.nodes}
    _add_model(root, types.values(), documented=False)
    return _text(root)


def model_xml(types: Iterable[NodeType]) -> str:
    """Return the types of node as a file that Groot2 imports."""
    root = _root()
    _add_model(root, types, documented=True)
    return _text(root)


def _root() -> Element:
    return Element("root", {"BTCPP_format": "4"})


def _add_node(above: Element, node: Node, subtree: Subtree) -> None:
    kind = node.config.type
    element = SubElement(above, kind.name)
    if kind.category is Category.SUBTREE:
        source = node.config.element
        element.attrib |= {"ID": source.get("ID"), "_fullpath": node.config.path, "_uid": str(node.uid)}
        element.attrib |= {name: source.get(name) for name in source.attributes if name not in NO_PORTS and not name.startswith("_")}
    else:
        element.attrib |= {"name": node.name, "_uid": str(node.uid), **node.config.ports}
    element.attrib |= conditions_of(node)
    for child in node.children:
        if child.blackboard is subtree.blackboard:
            _add_node(element, child, subtree)


def _add_model(root: Element, types: Iterable[NodeType], *, documented: bool) -> None:
    model = SubElement(root, "TreeNodesModel")
    for kind in sorted(types, key=lambda one: one.name):
        element = SubElement(model, kind.category.value, {"ID": kind.name})
        for port in kind.ports.values():
            written = SubElement(element, port.direction.value, {"name": port.name, "type": port.type.name})
            if port.default is not None:
                written.set("default", port.default)
            written.text = port.doc if port.doc.startswith(port.unit) else f"{port.doc} [{port.unit}]"
        if kind.doc and documented:
            fields = SubElement(element, "MetadataFields")
            SubElement(fields, "Metadata", {"description": kind.doc})


def _text(root: Element) -> str:
    return "".join(_lines(root, ""))


def _lines(element: Element, margin: str) -> Iterator[str]:
    """Yield the lines of an element, laid out and quoted as BehaviorTree.CPP's do."""
    words = "".join(f' {name}="{escape(value, _QUOTED)}"' for name, value in element.attrib.items())
    if not len(element) and not element.text:
        yield f"{margin}<{element.tag}{words}/>\n"
    elif not len(element):
        yield f"{margin}<{element.tag}{words}>{escape(element.text or '')}</{element.tag}>\n"
    else:
        yield f"{margin}<{element.tag}{words}>\n"
        for child in element:
            yield from _lines(child, margin + INDENT)
        yield f"{margin}</{element.tag}>\n"
