"""What anything in a mission decides by: of entries and failures that nothing asks, or only in one way, the search keeps no more."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from alula.common.graphs import reachable_from
from alula.missions.mission_file import DEGRADED, STOPPING
from alula.missions.world import FUNCTIONS
from alula.prove.mission.oracle import Oracle
from alula.prove.mission.unknown import Unknown, UnknownNumber, UnknownText
from alula.trees.access import scripts_of
from alula.trees.document import Element
from alula.trees.node import pointer
from alula.trees.palette import Category, NodeType, Palette
from alula.trees.reading import TreeFiles, is_port, type_name
from alula.trees.script import names_in, statements_of
from alula.trees.script.syntax import Assignment, Call, Chain, Comparison, Literal, Name, Node, walk

ANOTHER = "(another text)"
OUTCOME = frozenset({DEGRADED, STOPPING})
"""Entries by which the director decides."""


@dataclass(frozen=True)
class Asks:
    """What one node asks for: ``names`` are entries that it decides by, ``named`` all that it computes with.

    ``written``: entries that its scripts write; ``ends``, ``first``: of failures; ``skills`` are those whose executions it asks for.
    """

    names: frozenset[str]
    named: frozenset[str]
    written: frozenset[str]
    ends: frozenset[str]
    first: bool
    skills: frozenset[str]


@dataclass
class Read:
    """What is read of a mission's memory.

    ``names``: entries that scripts or nodes decide by; ``numbers``, ``texts``: what each of them is compared with; ``counted``: those
    that are computed, perhaps without end; ``whole``: those of which every value counts; ``ends``: those that are asked with ``failed``.
    """

    oracle: Oracle
    names: set[str] = field(default_factory=lambda: set(OUTCOME))
    numbers: dict[str, set[float]] = field(default_factory=dict)
    texts: dict[str, set[str]] = field(default_factory=dict)
    counted: set[str] = field(default_factory=set)
    whole: set[str] = field(default_factory=set)
    ordered: set[str] = field(default_factory=set)
    """Entries that are compared with more than literals: of a text every letter counts."""
    ends: set[str] = field(default_factory=set)
    asks_first: bool = False
    flows: set[tuple[str, str]] = field(default_factory=set)
    """Pairs of entries: what the second has may come of the first."""
    unread: frozenset[str] = frozenset()
    """Types of node that decide by nothing that is known."""
    free: frozenset[str] = frozenset()
    """Types of node that may decide by anything."""

    def sources(self, names: Iterable[str]) -> frozenset[str]:
        """Return entries, and all that what they have may come of."""
        return frozenset(reachable_from(names, lambda name: (source for source, target in self.flows if target == name)))

    def asks(self, element: Element, type_: NodeType) -> Asks:
        """Return what one node asks for."""
        one = Read(self.oracle, names=set())
        statements = [one for attribute in scripts_of(element, type_) for one in statements_of(attribute.value)]
        names = names_in(statements)
        named = {_bare(name) for name in names.read | names.asked}
        for statement in statements:
            _statement(one, statement, {})
        _ports(one, element, self.unread)
        if type_name(element) not in self.unread:
            named |= {_bare(pointer(value.value, name) or value.value) for name, value in element.attributes.items() if is_port(name)}
        written = frozenset(map(_bare, names.replaced))
        return Asks(frozenset(one.names), frozenset(named), written, frozenset(one.ends), one.asks_first, _skills_asked(statements))

    def value(self, name: str, value: object) -> object:
        """Return what is kept of an entry's value."""
        if isinstance(value, UnknownText) and value.known is not None:
            value = value.known
        if value is None:
            return None
        if name not in self.names:
            return self.kind(name, value)
        if name in self.whole or (isinstance(value, str) and name in self.ordered):
            return value
        if isinstance(value, UnknownText):
            return value
        if isinstance(value, str):
            return value if value in self.texts.get(name, ()) else ANOTHER
        if isinstance(value, int | float) and not isinstance(value, bool) and name in self.counted:
            return self._number(name, value)
        return value

    def kind(self, name: str, value: object) -> object:
        """Return something of the kind of a value, so that scripts can go on to compute with it."""
        number = isinstance(value, int | float)
        return (
            UnknownNumber(self.oracle, f"`{name}`") if number else ANOTHER if isinstance(value, str) else Unknown(self.oracle, f"`{name}`")
        )

    def _number(self, name: str, value: float) -> object:
        known = self.numbers.get(name, set())
        low, high = (value.low, value.high) if isinstance(value, UnknownNumber) else (value, value)
        least, most = min(known, default=math.inf), max(known, default=-math.inf)
        if least <= low and high <= most:
            return value
        wide_low = -math.inf if low < least else min(low, math.nextafter(most, math.inf))
        wide_high = math.inf if high > most else max(high, math.nextafter(least, -math.inf))
        return UnknownNumber(self.oracle, f"`{name}`", wide_low, wide_high)


def what_is_read(
    files: TreeFiles, palette: Palette, opaque: Iterable[str], constants: Mapping[str, float], oracle: Oracle, free: Iterable[str] = ()
) -> Read:
    """Return what the trees of a mission decide by.

    ``opaque`` are types of node that decide by nothing that is known, ``free`` those that may ask for more than the file shows.
    """
    read = Read(oracle, unread=frozenset(opaque), free=frozenset(free))
    for tree in files.trees.values():
        for element in tree.iterate():
            for attribute in scripts_of(element, type_of(element, palette)):
                for statement in statements_of(attribute.value):
                    _statement(read, statement, constants)
            _ports(read, element, read.unread)
    for model in files.models.values():
        for port in model.ports.values():
            key = pointer(port.default or "", port.name)
            if model.category is Category.SUBTREE and key is not None:
                read.flows |= {(_bare(key), port.name), (port.name, _bare(key))}
    read.names |= read.sources(read.names)
    for source, target in read.flows:  # one entry under two names, or a copy of it
        for one, other in ((source, target), (target, source)):
            read.numbers.setdefault(one, set()).update(read.numbers.get(other, ()))
            read.texts.setdefault(one, set()).update(read.texts.get(other, ()))
            read.whole |= {one} if other in read.whole else set()
            read.ordered |= {one} if other in read.ordered else set()
            read.counted |= {one} if other in read.counted else set()
    return read


def type_of(element: Element, palette: Palette) -> NodeType | None:
    """Return a node's type; None for the use of a subtree, and for what no palette has."""
    return None if element.tag == Category.SUBTREE.value else palette.get(type_name(element))


def _statement(read: Read, statement: Node, constants: Mapping[str, float]) -> None:
    targets = [one for one in walk(statement) if isinstance(one, Assignment) and isinstance(one.target, Name)]
    for one in targets:
        _assignment(read, one)
    inside = {id(part) for one in targets for part in walk(one)}
    read.names |= {_bare(one.name) for one in walk(statement) if isinstance(one, Name) and id(one) not in inside}
    for node in walk(statement):
        _look(read, node, constants)


def _assignment(read: Read, node: Assignment) -> None:
    target = _bare(node.target.name) if isinstance(node.target, Name) else ""
    sources = {_bare(one.name) for one in walk(node.value) if isinstance(one, Name)}
    read.flows |= {(source, target) for source in sources}
    if not node.replaces:
        read.flows.add((target, target))
    if not node.replaces or any(isinstance(one, Chain) for one in walk(node.value)):
        read.counted.add(target)


def _look(read: Read, node: Node, constants: Mapping[str, float]) -> None:
    if isinstance(node, Call):
        names = [one.value if isinstance(one, Literal) else one.name if isinstance(one, Name) else "" for one in node.arguments]
        read.asks_first |= node.function == "failed_first"
        read.ends |= {str(one) for one in names} if node.function == "failed" else set()
    if isinstance(node, Comparison):
        literals = [one.value for one in node.operands if isinstance(one, Literal)]
        literals += [constants[one.name] for one in node.operands if isinstance(one, Name) and one.name in constants]
        simple = all(isinstance(one, Name | Literal) for one in node.operands)
        for name in (_bare(one.name) for operand in node.operands for one in walk(operand) if isinstance(one, Name)):
            read.texts.setdefault(name, set()).update(str(one) for one in literals if isinstance(one, str))
            read.numbers.setdefault(name, set()).update(float(one) for one in literals if isinstance(one, int | float))
            if not simple or len(literals) < len(node.operands) - 1 or any(symbol not in {"==", "!="} for symbol in node.operators):
                read.ordered.add(name)


def _ports(read: Read, element: Element, unread: frozenset[str]) -> None:
    kind = type_name(element)
    for name, attribute in element.attributes.items():
        key = pointer(attribute.value, name) if is_port(name) else None
        if key is None:
            continue
        if element.tag == "SubTree":
            read.flows |= {(_bare(key), name), (name, _bare(key))}
        elif kind not in unread:
            read.names.add(_bare(key))
            read.whole.add(_bare(key))


def _skills_asked(statements: Iterable[Node]) -> frozenset[str]:
    """Return the skills whose executions statements ask for."""
    calls = [node for statement in statements for node in walk(statement) if isinstance(node, Call)]
    arguments = [one for call in calls if FUNCTIONS[call.function].kind == "skill" for one in call.arguments]
    return frozenset(str(one.value if isinstance(one, Literal) else getattr(one, "name", "")) for one in arguments)


def _bare(name: str) -> str:
    return name.removeprefix("@")
