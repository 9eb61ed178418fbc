"""Makes a tree of files and a palette."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from alula.trees.blackboard import Blackboard, Clock
from alula.trees.document import Element
from alula.trees.errors import FileError, Problem, TickError
from alula.trees.node import After, Before, Node, Script, Shared, Wiring, pointer
from alula.trees.nodes.subtree import SubTree
from alula.trees.palette import Category, NodeType, Palette
from alula.trees.reading import AUTOREMAP, POSTCONDITIONS, PRECONDITIONS, TreeFiles, is_port, node_name, type_name
from alula.trees.script import Program, ScriptError, parse
from alula.trees.script.scope import Unknown
from alula.trees.structure import verify
from alula.trees.tree import Subtree, Tree
from alula.trees.values import ANY, STRING, literal

SUBTREE = NodeType("SubTree", Category.SUBTREE, {}, "Another tree of the files.", SubTree, (1, 1))


class Surroundings(Protocol):
    """What scripts may name besides the blackboard: ``navigation.flight_status``, ``running(perception.zed_depthmap)``."""

    def value(self, name: str) -> object:
        """Return what a dotted name stands for, None where it stands for nothing."""
        ...

    def call(self, name: str, arguments: Sequence[object]) -> object:
        """Return what a function answers; raises KeyError where there is none, ValueError for wrong arguments."""
        ...


class Nothing:
    """No names beyond the blackboard's."""

    def value(self, name: str) -> object:  # noqa: ARG002
        """Know none."""
        return None

    def call(self, name: str, arguments: Sequence[object]) -> object:  # noqa: ARG002
        """Know none."""
        raise KeyError(name)


@dataclass(frozen=True)
class Scope:
    """What the scripts of one tree see: enumerators, the entries of its blackboard, and what surrounds the tree."""

    blackboard: Blackboard
    enums: Mapping[str, float]
    surroundings: Surroundings

    def get(self, name: str) -> object:
        """Return a value, None for an entry that was not written yet; raises KeyError where there is nothing of that name."""
        entry = self.blackboard.entry(name)
        if entry is not None:
            return entry.value
        value = self.surroundings.value(name)
        if value is None:
            raise KeyError(name)
        return value

    def set(self, name: str, value: object, *, create: bool) -> None:
        """Write an entry; raises KeyError where there is none and ValueError where it takes no such value."""
        try:
            self.blackboard.assign(name, value, create=create)
        except TickError as error:
            raise ValueError(str(error)) from error

    def call(self, name: str, args: Sequence[object]) -> object:
        """Ask what surrounds the tree."""
        return self.surroundings.call(name, args)


@dataclass
class BoundScript:
    """A script of a node; ``unknown`` is why its last answer as a condition was false, where that was because nobody knows."""

    program: Program
    scope: Scope
    where: str
    unknown: str = ""

    def run(self) -> object:
        """Run it; raises TickError."""
        try:
            return self.program.run(self.scope)
        except ScriptError as error:
            raise TickError(f"{self.where}: {error}") from error

    def holds(self) -> bool:
        """Run it as a condition; what is unknown does not hold. Raises TickError."""
        try:
            answer = self.program.judge(self.scope)
        except ScriptError as error:
            raise TickError(f"{self.where}: {error}") from error
        self.unknown = answer.why if isinstance(answer, Unknown) else ""
        return answer is True


def make_tree(
    files: TreeFiles,
    palette: Palette,
    clock: Clock,
    *,
    main: str = "",
    enums: Mapping[str, float] | None = None,
    surroundings: Surroundings | None = None,
    blackboard: Blackboard | None = None,
) -> Tree:
    """Build a tree.

    Args:
        files: what was read.
        palette: the types of node that it may have.
        clock: mission clock, nanoseconds.
        main: the tree to build, that of the files unless it is given.
        enums: names of numbers for scripts and switches.
        surroundings: what scripts may name besides.
        blackboard: of the main tree, with what is written on it beforehand.

    Raises:
        FileError: something is wrong in a file.
    """
    verify(files, palette)
    return build_tree(files, palette, clock, main=main, enums=enums, surroundings=surroundings, blackboard=blackboard)


def build_tree(
    files: TreeFiles,
    palette: Palette,
    clock: Clock,
    *,
    main: str = "",
    enums: Mapping[str, float] | None = None,
    surroundings: Surroundings | None = None,
    blackboard: Blackboard | None = None,
    after: int = 0,
) -> Tree:
    """Build a tree of files that were verified, as `make_tree` does: for one that needs several of them.

    Its nodes have the uids behind ``after``.
    """
    return _Builder(files, palette, Shared(clock), enums or {}, surroundings or Nothing(), after).tree(main or files.main, blackboard)


class _Builder:
    """Builds node by node; the limits on depth and number of nodes were verified."""

    def __init__(
        self, files: TreeFiles, palette: Palette, shared: Shared, enums: Mapping[str, float], surroundings: Surroundings, after: int
    ) -> None:
        self._files = files
        self._palette = palette
        self._shared = shared
        self._enums = enums
        self._surroundings = surroundings
        self._count = after
        self._subtrees: list[Subtree] = []

    def tree(self, main: str, blackboard: Blackboard | None) -> Tree:
        board = blackboard or Blackboard(self._shared.clock)
        root = self._subtree(main, "", board)
        return Tree(root, self._subtrees, self._files, self._shared)

    def _subtree(self, tree_id: str, path: str, board: Blackboard) -> Node:
        subtree = Subtree(tree_id, path, board)
        self._subtrees.append(subtree)
        return self._node(self._files.trees[tree_id].children[0], subtree)

    def _node(self, element: Element, subtree: Subtree) -> Node:
        self._count += 1
        is_subtree = element.tag == SUBTREE.name
        known = SUBTREE if is_subtree else self._palette.get(type_name(element))
        if known is None or known.make is None:
            raise FileError(Problem(element.place, f"'{type_name(element)}' is known from a model only", "nothing registers it"))
        node = self._made(known, element, subtree)
        subtree.nodes.append(node)
        children = [self._inner(node, element, subtree)] if is_subtree else [self._node(child, subtree) for child in element.children]
        node.children = children
        for child in children:
            child.parent = node
        return node

    def _made(self, known: NodeType, element: Element, subtree: Subtree) -> Node:
        uid, name = self._count, node_name(element)
        prefix = f"{subtree.path}/" if subtree.path else ""
        path = prefix + name + (f"::{uid}" if name == type_name(element) else "")
        scope = Scope(subtree.blackboard, self._enums, self._surroundings)
        ports = {name: one.value for name, one in element.attributes.items() if is_port(name)}
        if known is not SUBTREE:
            self._declare(known, ports, element, subtree.blackboard)
            for port in known.ports.values():
                if port.name not in ports and port.default is not None:
                    ports[port.name] = port.default
        compiled = _compiler(element, scope)
        wiring = Wiring(known, name, uid, path, element, ports, subtree.blackboard, self._shared, compiled, self._enums)
        node = known.wired(wiring)
        before, after = (_conditions(names, element, compiled) for names in (PRECONDITIONS, POSTCONDITIONS))
        node.before = Before(*before) if before else None
        node.after = After(*after) if after else None
        return node

    @staticmethod
    def _declare(known: NodeType, ports: Mapping[str, str], element: Element, board: Blackboard) -> None:
        """Give the entries that ports name their types."""
        for port in known.ports.values():
            key = pointer(ports[port.name], port.name) if port.name in ports else None
            if key is None:
                continue
            entry = board.entry(key)
            if entry is None:
                board.create(key, port.type)
            elif entry.type is not port.type and ANY not in {entry.type, port.type} and entry.type is not STRING:
                message = f"the port '{port.name}' is {port.type.name}, and the entry '{key}' is {entry.type.name} elsewhere"
                raise FileError(Problem(element.place_of(port.name), message, "use another entry"))

    def _inner(self, node: Node, element: Element, subtree: Subtree) -> Node:
        board = Blackboard(self._shared.clock, above=subtree.blackboard)
        tree_id = type_name(element)
        model = self._files.models.get(tree_id)
        board.autoremap = element.get(AUTOREMAP).lower() in {"1", "true"}
        texts = dict(node.wiring.ports)
        for port in [] if model is None or board.autoremap else model.ports.values():
            texts.setdefault(port.name, port.default or "")
        constants: dict[str, str] = {}
        for name, text in texts.items():
            key = pointer(text, name) if text != "=" else None
            if key is None:
                constants[name] = text
            else:
                board.remapped[name] = key
        _write(board, constants)
        prefix = f"{subtree.path}/" if subtree.path else ""
        path = prefix + (element.get("name") or f"{tree_id}::{node.uid}")
        return self._subtree(tree_id, path, board)


def _write(board: Blackboard, constants: Mapping[str, str]) -> None:
    """Write what a subtree is given as plain text, a number as one; these entries are its own, whatever is remapped."""
    autoremap, board.autoremap = board.autoremap, False
    for name, text in constants.items():
        board.set(name, literal(text))
    board.autoremap = autoremap


def _compiler(element: Element, scope: Scope) -> Callable[[str, str], Script]:
    def compiled(text: str, attribute: str) -> Script:
        try:
            program = parse(text)
        except ScriptError as error:
            known = element.attributes.get(attribute)
            place = element.place if known is None or known.value != text else known.place_of(error.offset)
            raise FileError(Problem(place, error.message, error.cure)) from error
        return BoundScript(program, scope, f"{element.place_of(attribute)} ({node_name(element)}, {attribute})")

    return compiled


def _conditions(names: Sequence[str], element: Element, compiled: Callable[[str, str], Script]) -> list[Script | None]:
    """Return the scripts of these attributes, None where there is none; empty when there are none at all."""
    if not any(name in element.attributes for name in names):
        return []
    return [compiled(element.get(name), name) if name in element.attributes else None for name in names]
