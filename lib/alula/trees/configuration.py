"""Configure the nodes of a tree: every use of a subtree has nodes of its own, each with its type, its ports and its view of the blackboard.

The factory makes the nodes of them that tick. The check reads them as they are, so nothing here refuses what is wrong in the files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from alula.trees.attributes import AUTOREMAP, is_port, node_name, type_name
from alula.trees.blackboard import Blackboard
from alula.trees.document import Element
from alula.trees.errors import FileError, Problem, TickError
from alula.trees.node import NodeConfig, Script, Shared, TickableType, pointer
from alula.trees.node_type import Category, unknown_type
from alula.trees.nodes.subtree import SubTree
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.script import Program, ScriptError, parse
from alula.trees.script.scope import Unknown
from alula.trees.values import literal

SUBTREE = TickableType("SubTree", Category.SUBTREE, {}, "Another tree of the files.", (1, 1), make=SubTree)


class ScriptEnvironment(Protocol):
    """What scripts may name besides the blackboard: ``navigation.flight_status``, ``running(perception.zed_depthmap)``."""

    def value(self, name: str) -> object:
        """Return what a dotted name stands for, None where it stands for nothing."""
        ...

    def call(self, name: str, arguments: Sequence[object]) -> object:
        """Return what a function answers; raises KeyError where there is none, ValueError for wrong arguments."""
        ...


class EmptyEnvironment:
    """No names beyond the blackboard's."""

    def value(self, name: str) -> object:  # noqa: ARG002
        """Return None."""
        return None

    def call(self, name: str, arguments: Sequence[object]) -> object:  # noqa: ARG002
        """Raise KeyError."""
        raise KeyError(name)


@dataclass(frozen=True)
class Scope:
    """What the scripts of one tree see: enumerators, the entries of its blackboard, and what surrounds the tree."""

    blackboard: Blackboard
    enums: Mapping[str, float]
    environment: ScriptEnvironment

    def get(self, name: str) -> object:
        """Return a value, None for an entry that was not written yet; raises KeyError where there is nothing of that name."""
        entry = self.blackboard.entry(name)
        if entry is not None:
            return entry.value
        value = self.environment.value(name)
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
        return self.environment.call(name, args)


@dataclass
class BoundScript:
    """A script of a node; ``unknown`` is why its last answer as a condition was false, where that was because a value is not known."""

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


def configure(
    files: TreeFiles,
    registry: NodeRegistry,
    main: str,
    shared: Shared,
    *,
    enums: Mapping[str, float] | None = None,
    environment: ScriptEnvironment | None = None,
    blackboard: Blackboard | None = None,
    after: int = 0,
) -> NodeConfig:
    """Return the configuration of a tree's top node, with its subtrees put in; `structure.verify` has ruled out cycles and giants.

    Arguments are those of `factory.build_tree`. On the blackboards stands nothing yet but what uses of subtrees give these as plain text.
    """
    configurer = _Configurer(files, registry, shared, enums or {}, environment or EmptyEnvironment(), after)
    return configurer.node(files.trees[main].children[0], blackboard or Blackboard(shared.clock), "", None)


def path_inside(use: NodeConfig, path: str) -> str:
    """Return the path of the tree that a node uses, which stands in the one with the path ``path``."""
    return _joined(path, use.element.get("name") or f"{type_name(use.element)}::{use.uid}")


def _joined(path: str, name: str) -> str:
    return f"{path}/{name}" if path else name


class _Configurer:
    def __init__(
        self,
        files: TreeFiles,
        registry: NodeRegistry,
        shared: Shared,
        enums: Mapping[str, float],
        environment: ScriptEnvironment,
        after: int,
    ) -> None:
        self._files = files
        self._registry = registry
        self._shared = shared
        self._enums = enums
        self._environment = environment
        self._count = after

    def node(self, element: Element, board: Blackboard, path: str, parent: NodeConfig | None) -> NodeConfig:
        """Return the configuration of a node with all below it; ``path`` is that of the tree that it stands in."""
        self._count += 1
        uid, name, tag = self._count, node_name(element), type_name(element)
        is_subtree = element.tag == SUBTREE.name
        known = SUBTREE if is_subtree else self._registry.get(tag) or unknown_type(tag)
        ports = {name: one.value for name, one in element.attributes.items() if is_port(name)}
        model = self._files.models.get(tag) if is_subtree and not _autoremaps(element) else known
        for port in () if model is None else model.ports.values():
            if port.name not in ports and port.default is not None:
                ports[port.name] = port.default
        whole = _joined(path, name if name != tag else f"{name}::{uid}")
        compiled = _compiler(element, Scope(board, self._enums, self._environment))
        config = NodeConfig(known, name, uid, whole, element, ports, board, self._shared, compiled, self._enums, parent)
        inner: Sequence[Element] = element.children
        if is_subtree:
            tree = self._files.trees.get(tag)
            inner, board, path = tree.children[:1] if tree is not None else (), self._inside(config), path_inside(config, path)
        config.children.extend(self.node(child, board, path, config) for child in inner)
        return config

    def _inside(self, use: NodeConfig) -> Blackboard:
        """Return the blackboard of the tree that a node uses."""
        board = Blackboard(self._shared.clock, above=use.blackboard)
        board.autoremap = _autoremaps(use.element)
        plain = plain_inside(use)
        board.remapped = {name: pointer(text, name) or name for name, text in use.ports.items() if name not in plain}
        _write(board, plain)
        return board


def plain_inside(use: NodeConfig) -> Mapping[str, str]:
    """Return what the use of a subtree writes into entries of its own, as text: all that names no entry above."""
    return {name: text for name, text in use.ports.items() if text == "=" or pointer(text, name) is None}


def _autoremaps(use: Element) -> bool:
    return use.get(AUTOREMAP).lower() in {"1", "true"}


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
