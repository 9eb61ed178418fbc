"""Of which type values are that nodes without a class write, and inputs of a mission: of what their readers need, as nothing else says it.

    <Look where="{found}"/>  <ScriptCondition code="found == 'door'"/>     # `found` is a text

Only of what is merely declared this is assumed: the class of a robot's own node tells its types itself.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from alula.common.graphs import reachable_from
from alula.prove.mission.reading import type_of
from alula.trees.access import scripts_of
from alula.trees.document import Element
from alula.trees.node import pointer
from alula.trees.palette import Category, Palette, Port
from alula.trees.reading import TreeFiles, is_port, type_name
from alula.trees.script import statements_of
from alula.trees.script.syntax import Assignment, Chain, Comparison, Conditional, Literal, Name, Node, Prefix, children
from alula.trees.values import ANY, BOOL, DOUBLE, NUMBERS, STRING, PortType

LOGIC = frozenset({"&&", "||"})
JOINS = frozenset({"+", ".."})
"""Operators that take texts, too."""


@dataclass(frozen=True)
class Uses:
    """``types``: of entries, by how they are used; ``declared``: types of node that have no class."""

    types: Mapping[str, PortType] = field(default_factory=dict)
    declared: frozenset[str] = frozenset()

    @classmethod
    def of(cls, files: TreeFiles, palette: Palette, declared: Collection[str], unread: Collection[str], numbers: Collection[str]) -> Uses:
        """Read them of the trees of a mission.

        ``unread`` are types of node that decide by nothing that is known, ``numbers`` are names that scripts have for numbers.
        """
        seen = _Seen(frozenset(numbers))
        for element in (element for tree in files.trees.values() for element in tree.iterate()):
            for attribute in scripts_of(element, type_of(element, palette)):
                for statement in statements_of(attribute.value):
                    seen.condition(statement)
            seen.ports(element, palette, unread)
        for model in files.models.values():
            for port in model.ports.values() if model.category is Category.SUBTREE else ():
                seen.same(port.name, pointer(port.default or "", port.name))
        return cls(dict(seen.types()), frozenset(declared))

    def type_of(self, node: str, port: Port, entry: str) -> PortType | None:
        """Return the type of what a type of node writes into an entry, None where nothing says any and each reader can read it."""
        if port.type is not ANY or node not in self.declared:
            return port.type
        return self.types.get(entry.removeprefix("@"))

    def type_of_input(self, port: Port) -> PortType | None:
        """Return the type of an input of the mission; None as of ``type_of``."""
        return port.type if port.type is not ANY else self.types.get(port.name)


class _Seen:
    """What is seen of entries: types that scripts and ports need, and pairs that have one value."""

    def __init__(self, numbers: frozenset[str]) -> None:
        self._numbers = numbers
        self._needed: dict[str, set[PortType]] = {}
        self._read_as_text: set[str] = set()
        """Entries that a port reads as text, which it can of numbers, too."""
        self._pairs: set[tuple[str, str]] = set()

    def same(self, one: str, other: str | None) -> None:
        """Note two names of one value, or one that is copied."""
        if other is not None:
            self._pairs |= {(one, other.removeprefix("@")), (other.removeprefix("@"), one)}

    def condition(self, node: Node) -> None:
        """Look at a part of a script of which it is asked whether it is true."""
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
                self.same(target.removeprefix("@"), source)
        for child in children(node):
            self._value(child)

    def _together(self, operands: Iterable[Node], *, of_text: bool) -> None:
        """Look at operands that are of one type."""
        several = list(operands)
        names = [one for one in several if isinstance(one, Name) and one.name not in self._numbers and "." not in one.name]
        texts = [one for one in several if isinstance(one, Literal) and isinstance(one.value, str)]
        numbers = [one for one in several if (isinstance(one, Literal) and one not in texts) or getattr(one, "name", "") in self._numbers]
        for name in names:
            if texts and of_text:
                self._need(name, STRING)
            if numbers or not of_text:
                self._need(name, DOUBLE)
            self.same(name.name.removeprefix("@"), names[0].name)

    def _need(self, name: Name, type_: PortType) -> None:
        if "." not in name.name and name.name not in self._numbers:
            self._needed.setdefault(name.name.removeprefix("@"), set()).add(type_)

    def ports(self, element: Element, palette: Palette, unread: Collection[str]) -> None:
        """Look at what the ports of a node read."""
        known = type_of(element, palette)
        keys = {name: pointer(one.value, name) for name, one in element.attributes.items() if is_port(name)}
        if known is None:
            for name, key in keys.items():
                self.same(name, key)
        elif type_name(element) not in unread:
            copies = [key for key in keys.values() if key is not None] if any(one.written_from for one in known.ports.values()) else []
            for key in copies:
                self.same(copies[0].removeprefix("@"), key)
            for name, key in keys.items():
                type_ = known.ports[name].type if name in known.ports else ANY
                if key is not None and type_ is STRING:
                    self._read_as_text.add(key.removeprefix("@"))
                elif key is not None and type_ is not ANY:
                    self._needed.setdefault(key.removeprefix("@"), set()).add(type_)

    def types(self) -> Iterator[tuple[str, PortType]]:
        """Yield entries with their types, where all that is seen of one agrees."""
        alike: dict[str, set[str]] = {}
        for one, other in self._pairs:
            alike.setdefault(one, set()).add(other)
        for name in sorted({*self._needed, *self._read_as_text, *alike}):
            names = reachable_from([name], lambda one: alike.get(one, ()))
            needed = frozenset(type_ for one in names for type_ in self._needed.get(one, ()))
            if not needed and not names.isdisjoint(self._read_as_text):
                yield name, STRING
            elif needed:
                yield from ((name, type_) for type_ in _agreed(needed))


def _agreed(types: Collection[PortType]) -> Iterator[PortType]:
    """Yield the type that all values of these types can be; nothing where there is none."""
    if len(types) == 1:
        yield from types
    elif all(one in NUMBERS for one in types):
        whole = [one for one in types if one.limits is not None]
        yield min(whole, key=lambda one: (one.limits or (0, 0))[1] - (one.limits or (0, 0))[0]) if whole else DOUBLE
