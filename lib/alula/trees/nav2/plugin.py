"""The registry of Nav2's own nodes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from alula.trees.attributes import is_port, type_name
from alula.trees.document import Element
from alula.trees.nav2 import controls, decorators
from alula.trees.nav2.declared import declared
from alula.trees.node import Node
from alula.trees.node_type import CHILDREN, NodeType
from alula.trees.registry import NodeRegistry

TICKED: tuple[type[Node], ...] = (
    controls.PipelineSequence,
    controls.RecoveryNode,
    controls.RoundRobin,
    controls.NonblockingSequence,
    controls.PersistentSequence,
    decorators.RateController,
    decorators.SingleTrigger,
    decorators.GoalUpdatedController,
)
"""Those that need no robot."""
TOLD: tuple[type[Node], ...] = (
    controls.PauseResumeController,
    decorators.DistanceController,
    decorators.SpeedController,
    decorators.GoalUpdater,
    decorators.PathLongerOnApproach,
)
"""Those that ask a robot or a program, with what their classes tell of them; nothing here ticks them."""


def registry(release: str = "") -> NodeRegistry:
    """Return Nav2's nodes: of a release, as it declares them; else of all, with classes for those that can be ticked here."""
    types = dict(declared(release))
    if not release:
        ticked = NodeRegistry()
        types.update({one.name: one for one in map(ticked.register, TICKED)})
        types.update({node.__name__: replace(types[node.__name__], tells=node, children=_children(node)) for node in TOLD})
    return NodeRegistry(types.values())


def registry_for(trees: Iterable[Element]) -> NodeRegistry:
    """Return those of Nav2's nodes that trees may mean.

    A leaf is another node of that name where a use gives it ports and none of them is Nav2's.
    """
    known = registry()
    leaves = {one.name: one for one in known if one.children == (0, 0)}
    others: set[str] = set()
    for tree in trees:
        for element in tree.iterate():
            leaf = leaves.get(type_name(element))
            if leaf is not None and _is_another(element, leaf):
                others.add(leaf.name)
    return NodeRegistry(one for one in known if one.name not in others)


def told_of(declared: NodeType, known: NodeType) -> NodeType:
    """Return a type as it is declared elsewhere, with what is known of Nav2's node of that name besides."""
    ports = {}
    for name, port in declared.ports.items():
        mine = known.ports[name]
        ports[name] = replace(port, optional=mine.optional, unchecked=mine.unchecked)
    return replace(declared, ports=ports, runs=known.runs, tells=known.tells)


def _is_another(element: Element, leaf: NodeType) -> bool:
    ports = [name for name in element.attributes if is_port(name)]
    return bool(element.children) or (bool(ports) and not any(name in leaf.ports for name in ports))


def _children(node: type[Node]) -> tuple[int, int | None]:
    return node.child_count or CHILDREN[node.category]
