"""The types of node that trees of others need a robot for: declared, or guessed from their uses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from alula.trees import nav2
from alula.trees.attributes import AUTOREMAP, is_port, type_name
from alula.trees.document import Element
from alula.trees.guessing import guessed_types
from alula.trees.node import pointer
from alula.trees.node_type import Category, NodeType
from alula.trees.ports import Direction, Port
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.standard import standard_registry
from alula.trees.values import ANY, DOUBLE, INT

Given = Mapping[tuple[str, str], Sequence[str]]
"""What uses give to ports, by type of node and port."""


def needed(files: TreeFiles) -> TreeFiles:
    """Return a main tree's files without the trees that it does not use."""
    found, left = {files.main}, [files.main]
    while left:
        used = {type_name(one) for one in files.uses(left.pop())} & files.trees.keys() - found
        found |= used
        left += used
    return replace(files, trees={name: tree for name, tree in files.trees.items() if name in found})


def make_actions_of_missing_trees(files: TreeFiles) -> set[str]:
    """Have uses of trees that are in no file be actions, in place; return the IDs of those trees."""
    missing = [one for name in files.trees for one in files.uses(name) if one.get("ID") not in files.trees]
    for one in missing:
        one.tag = Category.ACTION.value
        one.attributes.pop(AUTOREMAP, None)
    return {one.get("ID") for one in missing}


def elements_of(mains: Sequence[TreeFiles]) -> list[Element]:
    """Return the trees that main trees need, each once, in the order of the files."""
    return list({id(tree): tree for files in mains for tree in files.trees.values()}.values())


def nodes_of(tree: Element) -> Iterator[Element]:
    """Yield the nodes of a tree; uses of subtrees are none."""
    yield from (one for top in tree.children for one in top.iterate() if one.tag != Category.SUBTREE.value)


def known_registry(mains: Sequence[TreeFiles]) -> NodeRegistry:
    """Return the types that need no robot: BehaviorTree.CPP's, and those of Nav2 with children, unless a file declares others."""
    declared = {name: one for files in mains for name, one in files.models.items()}
    registry = standard_registry()
    for one in nav2.registry():
        if one.is_tickable and one.children != (0, 0) and declared.get(one.name, one).category is one.category:
            registry.add(one)
    return registry


def foreign_types(mains: Sequence[TreeFiles]) -> dict[str, NodeType]:
    """Return by their IDs the types of all nodes that trees use and that need a robot; what is not declared is guessed from the uses."""
    trees, known = elements_of(mains), known_registry(mains)
    given: dict[tuple[str, str], list[str]] = {}
    for node in (node for tree in trees for node in nodes_of(tree)):
        for attribute in filter(is_port, node.attributes):
            given.setdefault((type_name(node), attribute), []).append(node.get(attribute))
    used = {type_name(node) for tree in trees for node in nodes_of(tree)}
    models = {one.name: one for one in nav2.registry() if all(port in one.ports for name, port in given if name == one.name)}
    models.update((name, one) for files in reversed(mains) for name, one in files.models.items())
    declared = NodeRegistry(
        replace(one, category=_category(one)) for name, one in models.items() if name in used and known.get(name) is None
    )
    guessed = [_widened(one, given) for one in guessed_types(trees, known)]
    undeclared = [_widened(one, given) for one in guessed_types(trees, known | declared)]
    both = [_merged(model, one, given) for one in guessed if (model := declared.get(one.name)) is not None]
    return {one.name: one for one in sorted((*undeclared, *both), key=lambda one: one.name)}


def _category(model: NodeType) -> Category:
    """Return what a declared node is; a subtree that is in no file is an action."""
    return Category.ACTION if model.category is Category.SUBTREE else model.category


def _widened(guess: NodeType, given: Given) -> NodeType:
    """Return a guess whose whole numbers are real ones where some uses give a number and others an entry: that may hold any number."""

    def is_mixed(name: str) -> bool:
        return {pointer(one, name) is None for one in given[guess.name, name]} == {True, False}

    ports = guess.ports.items()
    return replace(guess, ports={name: replace(one, type=DOUBLE) if one.type is INT and is_mixed(name) else one for name, one in ports})


def _merged(model: NodeType, guess: NodeType, given: Given) -> NodeType:
    """Return a declared type with the ports that uses give besides, without inputs that no use gives and that have no default."""

    def port(name: str) -> Port:
        if name not in model.ports:
            return guess.ports[name]
        told = model.ports[name]
        return replace(told, type=guess.ports[name].type) if told.type is ANY and name in guess.ports else told

    found = [port(name) for name in {**model.ports, **guess.ports}]
    kept = [one for one in found if (model.name, one.name) in given or one.default is not None or one.direction is Direction.OUTPUT]
    return replace(model, ports={one.name: one for one in kept}, doc="")
