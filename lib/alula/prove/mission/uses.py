"""The types of unknown values: of what nodes without a class write, and of a mission's inputs, as far as their readers need one.

    <Look where="{found}"/>  <ScriptCondition code="found == 'door'"/>     # `found` is a text

Only of what is merely declared this is assumed: the class of a robot's own node tells its types itself.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from alula.common.graphs import reachable_from
from alula.trees.access import Key, scripts_of
from alula.trees.node import Node as TreeNode
from alula.trees.node import NodeConfig, pointer
from alula.trees.ports import Port
from alula.trees.script import statements_of
from alula.trees.script.syntax import Assignment, Chain, Comparison, Conditional, Literal, Name, Node, Prefix, children
from alula.trees.values import ANY, BOOL, DOUBLE, NUMBERS, STRING, PortType

LOGIC = frozenset({"&&", "||"})
JOINS = frozenset({"+", ".."})
"""Operators that take texts, too."""


@dataclass(frozen=True)
class Uses:
    """``inputs``: types of the main tree's entries; ``ports``: of what nodes without a known class write, by their uids and the ports."""

    inputs: Mapping[str, PortType] = field(default_factory=dict)
    ports: Mapping[tuple[int, str], PortType | None] = field(default_factory=dict)

    @classmethod
    def of(cls, roots: Iterable[NodeConfig], declared: Collection[str], unread: Collection[str], numbers: Collection[str]) -> Uses:
        """Collect the types from the trees of a mission, which share one blackboard.

        ``declared`` are types of node that have no class, ``unread`` those that decide by nothing that is known, ``numbers`` are names that
        scripts have for numbers.
        """
        several = [config for root in roots for config in root.walk()]
        seen = _Seen(frozenset(numbers))
        for config in several:
            seen.at(config, unread)
        types = dict(seen.types())
        written = ((one, port, pointer(text, port)) for one in several if one.type.name in declared for port, text in one.ports.items())
        ports = {(one.uid, port): types.get(one.blackboard.where(name)) for one, port, name in written if name is not None}
        return cls({name: type_ for (board, name), type_ in types.items() if board.above is None}, ports)

    def type_of(self, node: TreeNode, port: Port) -> PortType | None:
        """Return the type of what a node writes to a port, None where no reader needs a type."""
        return port.type if port.type is not ANY else self.ports.get((node.uid, port.name), ANY)

    def type_of_input(self, port: Port) -> PortType | None:
        """Return the type of an input of the mission; None as of ``type_of``."""
        return port.type if port.type is not ANY else self.inputs.get(port.name)


class _Seen:
    """What is seen of entries: types that scripts and ports need, and pairs that have one value."""

    def __init__(self, numbers: frozenset[str]) -> None:
        self.numbers = numbers
        self._needed: dict[Key, set[PortType]] = {}
        self._read_as_text: set[Key] = set()
        """Entries that a port reads as text, which it can of numbers, too."""
        self._pairs: set[tuple[Key, Key]] = set()

    def at(self, config: NodeConfig, unread: Collection[str]) -> None:
        """Collect the types that a node needs; ``unread`` are types of node that decide by no known value."""
        for attribute in scripts_of(config.element, config.type):
            for statement in statements_of(attribute.value):
                _InScript(self, config).condition(statement)
        if config.type.name not in unread and not config.is_subtree:
            self._ports(config)

    def same(self, one: Key, other: Key) -> None:
        """Record that two entries have one value, or that one is copied."""
        self._pairs |= {(one, other), (other, one)}

    def need(self, entry: Key, type_: PortType) -> None:
        """Record a type that an entry has to have."""
        self._needed.setdefault(entry, set()).add(type_)

    def is_entry(self, name: str) -> bool:
        """Return whether a name in a script is an entry's."""
        return "." not in name and name not in self.numbers

    def _ports(self, config: NodeConfig) -> None:
        known = config.type.ports
        names = {port: pointer(text, port) for port, text in config.ports.items()}
        keys = {port: config.blackboard.where(name) for port, name in names.items() if name is not None}
        copies = list(keys.values()) if any(one.written_from for one in known.values()) else []
        for key in copies:
            self.same(copies[0], key)
        for port, key in keys.items():
            type_ = known[port].type if port in known else ANY
            if type_ is STRING:
                self._read_as_text.add(key)
            elif type_ is not ANY:
                self.need(key, type_)

    def types(self) -> Iterator[tuple[Key, PortType]]:
        """Yield entries with their types, where all readers of one agree."""
        alike: dict[Key, set[Key]] = {}
        for one, other in self._pairs:
            alike.setdefault(one, set()).add(other)
        for entry in dict.fromkeys([*self._needed, *self._read_as_text, *alike]):
            several = reachable_from([entry], lambda one: alike.get(one, ()))
            needed = frozenset(type_ for one in several for type_ in self._needed.get(one, ()))
            if not needed and not several.isdisjoint(self._read_as_text):
                yield entry, STRING
            elif needed:
                yield from ((entry, type_) for type_ in _agreed(needed))


class _InScript:
    """Looks at a script of a node."""

    def __init__(self, seen: _Seen, config: NodeConfig) -> None:
        self._seen = seen
        self._board = config.blackboard

    def condition(self, node: Node) -> None:
        """Collect from a part of a script that is read as a truth value."""
        if isinstance(node, Name):
            self._need(node, BOOL)
        self._value(node)

    def _value(self, node: Node) -> None:
        match node:
            case Comparison(operands=operands):
                self._together(operands, of_text=True)
            case Chain(operands=operands, operators=operators) if LOGIC.issuperset(operators):
                for one in operands:
                    self.condition(one)
                return
            case Chain(operands=operands, operators=operators):
                self._together(operands, of_text=JOINS.issuperset(operators))
            case Prefix(operator="!", operand=operand):
                self.condition(operand)
                return
            case Prefix(operand=Name() as name):
                self._need(name, DOUBLE)
            case Conditional(condition=condition):
                self.condition(condition)
            case Assignment(target=Name(name=target), value=Name(name=source)):
                self._seen.same(self._board.where(target), self._board.where(source))
        for child in children(node):
            self._value(child)

    def _together(self, operands: Iterable[Node], *, of_text: bool) -> None:
        """Look at operands that are of one type."""
        several = list(operands)
        names = [one for one in several if isinstance(one, Name) and self._seen.is_entry(one.name)]
        texts = [one for one in several if isinstance(one, Literal) and isinstance(one.value, str)]
        numbers = [one for one in several if one not in texts and (isinstance(one, Literal) or self._is_number(one))]
        for name in names:
            if texts and of_text:
                self._need(name, STRING)
            if numbers or not of_text:
                self._need(name, DOUBLE)
            self._seen.same(self._board.where(name.name), self._board.where(names[0].name))

    def _is_number(self, node: Node) -> bool:
        """Return whether it is a name that scripts have for a number."""
        return isinstance(node, Name) and node.name in self._seen.numbers

    def _need(self, name: Name, type_: PortType) -> None:
        if self._seen.is_entry(name.name):
            self._seen.need(self._board.where(name.name), type_)


def _agreed(types: Collection[PortType]) -> Iterator[PortType]:
    """Yield the type that all values of these types can be; nothing where there is none."""
    if len(types) == 1:
        yield from types
    elif all(one in NUMBERS for one in types):
        whole = [one for one in types if one.limits is not None]
        yield min(whole, key=lambda one: (one.limits or (0, 0))[1] - (one.limits or (0, 0))[0]) if whole else DOUBLE
