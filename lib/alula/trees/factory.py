"""Makes a tree of files and a registry of nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from alula.trees.attributes import POSTCONDITIONS, PRECONDITIONS, type_name
from alula.trees.blackboard import Blackboard, Clock
from alula.trees.configuration import ScriptEnvironment, configure, path_inside
from alula.trees.errors import FileError, Problem
from alula.trees.node import After, Before, Node, NodeConfig, Script, Shared, TickableType, pointer
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.structure import verify
from alula.trees.tree import Subtree, Tree
from alula.trees.values import ANY, STRING


def make_tree(
    files: TreeFiles,
    registry: NodeRegistry,
    clock: Clock,
    *,
    main: str = "",
    enums: Mapping[str, float] | None = None,
    environment: ScriptEnvironment | None = None,
    blackboard: Blackboard | None = None,
) -> Tree:
    """Build a tree.

    Args:
        files: what was read.
        registry: the types of node that it may have.
        clock: mission clock, nanoseconds.
        main: the tree to build, that of the files unless it is given.
        enums: names of numbers for scripts and switches.
        environment: what scripts may name besides.
        blackboard: of the main tree, with what is written on it beforehand.

    Raises:
        FileError: something is wrong in a file.
    """
    verify(files, registry)
    return build_tree(files, registry, clock, main=main, enums=enums, environment=environment, blackboard=blackboard)


def build_tree(
    files: TreeFiles,
    registry: NodeRegistry,
    clock: Clock,
    *,
    main: str = "",
    enums: Mapping[str, float] | None = None,
    environment: ScriptEnvironment | None = None,
    blackboard: Blackboard | None = None,
    after: int = 0,
) -> Tree:
    """Build a tree of files that were verified, as `make_tree` does: for one that needs several of them.

    Its nodes have the uids behind ``after``.
    """
    shared = Shared(clock)
    board = blackboard or Blackboard(clock)
    config = configure(files, registry, main or files.main, shared, enums=enums, environment=environment, blackboard=board, after=after)
    subtrees = [Subtree(main or files.main, "", board)]
    return Tree(_made(config, subtrees[0], subtrees), subtrees, files, shared)


def _made(config: NodeConfig, subtree: Subtree, subtrees: list[Subtree]) -> Node:
    """Make a node with all below it; the limits on depth and number of nodes were verified."""
    element, known = config.element, config.type
    if not isinstance(known, TickableType):
        raise FileError(Problem(element.place, f"'{type_name(element)}' is known from a model only", "nothing registers it"))
    _declare(config)
    node = known.instantiate(config)
    before, after = (_conditions(names, config) for names in (PRECONDITIONS, POSTCONDITIONS))
    node.before = Before(*before) if before else None
    node.after = After(*after) if after else None
    subtree.nodes.append(node)
    if config.is_subtree:
        subtree = Subtree(type_name(element), path_inside(config, subtree.path), config.children[0].blackboard)
        subtrees.append(subtree)
    node.children = [_made(child, subtree, subtrees) for child in config.children]
    for child in node.children:
        child.parent = node
    return node


def _declare(config: NodeConfig) -> None:
    """Give the entries that ports name their types."""
    element, board = config.element, config.blackboard
    for port in config.type.ports.values():
        key = pointer(element.get(port.name), port.name) if port.name in element.attributes else None
        if key is None:
            continue
        entry = board.entry(key)
        if entry is None:
            board.create(key, port.type)
        elif entry.type is not port.type and ANY not in {entry.type, port.type} and entry.type is not STRING:
            message = f"the port '{port.name}' is {port.type.name}, and the entry '{key}' is {entry.type.name} elsewhere"
            raise FileError(Problem(element.place_of(port.name), message, "use another entry"))


def _conditions(names: Sequence[str], config: NodeConfig) -> list[Script | None]:
    """Return the scripts of these attributes, None where there is none; empty when there are none at all."""
    element = config.element
    if not any(name in element.attributes for name in names):
        return []
    return [config.compile(element.get(name), name) if name in element.attributes else None for name in names]
