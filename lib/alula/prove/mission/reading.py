"""What anything in a mission decides by: of entries and failures that nothing asks, or only in one way, the search keeps no more."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from alula.common.graphs import reachable_from
from alula.missions.environment import FUNCTIONS
from alula.missions.mission_file import DEGRADED, STOPPING
from alula.prove.mission.oracle import Oracle
from alula.prove.mission.unknown import Unknown, UnknownNumber, UnknownText
from alula.trees.access import Accesses, Key
from alula.trees.node import NodeConfig, pointer
from alula.trees.script import Names, names_in, statements_of
from alula.trees.script.syntax import Assignment, Call, Chain, Comparison, Literal, Name, Node, walk

ANOTHER = "(another text)"
OUTCOME = frozenset({DEGRADED, STOPPING})
"""Entries by which the director decides."""


@dataclass(frozen=True)
class Asks:
    """What one node asks for: ``names`` are entries that it decides by, ``named`` all that it computes with.

    ``written``: entries that its scripts write; ``ends``, ``first``: of failures; ``skills`` are those whose executions it asks for.
    """

    names: frozenset[Key]
    named: frozenset[Key]
    written: frozenset[Key]
    ends: frozenset[str]
    first: bool
    skills: frozenset[str]


@dataclass
class Reading:
    """What is read of a mission's memory, by a node or by several.

    ``names``: entries that scripts or nodes decide by; ``numbers``, ``texts``: what each of them is compared with; ``counted``: those
    that are computed, perhaps without end; ``whole``: those of which every value counts; ``ends``: those that are asked with ``failed``.
    """

    names: set[Key] = field(default_factory=set)
    numbers: dict[Key, set[float]] = field(default_factory=dict)
    texts: dict[Key, set[str]] = field(default_factory=dict)
    counted: set[Key] = field(default_factory=set)
    whole: set[Key] = field(default_factory=set)
    ordered: set[Key] = field(default_factory=set)
    """Entries that are compared with more than literals: of a text every letter counts."""
    ends: set[str] = field(default_factory=set)
    asks_first: bool = False
    flows: dict[Key, set[Key]] = field(default_factory=dict)
    """By entry those that what it has may come of."""

    def add(self, other: Reading) -> None:
        """Add what another node reads."""
        self.names |= other.names
        self.counted |= other.counted
        self.whole |= other.whole
        self.ordered |= other.ordered
        self.ends |= other.ends
        self.asks_first |= other.asks_first
        for key, numbers in other.numbers.items():
            self.numbers.setdefault(key, set()).update(numbers)
        for key, texts in other.texts.items():
            self.texts.setdefault(key, set()).update(texts)
        for key, sources in other.flows.items():
            self.flows.setdefault(key, set()).update(sources)

    def sources(self, names: Iterable[Key]) -> frozenset[Key]:
        """Return the entries of these names, and all entries that their values may come from."""
        return frozenset(reachable_from(names, lambda name: self.flows.get(name, ())))


@dataclass(kw_only=True)
class Read(Reading):
    """What a mission reads of its memory. Each node is read once.

    ``unread`` are types of node that decide by nothing that is known, ``free`` those that may decide by anything. Entries that are counted
    are kept exactly below ``exactly``, from 0 to the greatest number that they are compared with. ``constants`` are numbers by name.
    """

    oracle: Oracle
    constants: Mapping[str, float]
    exactly: int = 0
    unread: frozenset[str] = frozenset()
    free: frozenset[str] = frozenset()
    accesses: Accesses = field(default_factory=lambda: Accesses(lambda script: statements_of(script.value), None))
    _nodes: dict[NodeConfig, tuple[Reading, Asks]] = field(default_factory=dict)

    def of_node(self, config: NodeConfig) -> Reading:
        """Return what one node reads."""
        return self._node(config)[0]

    def asks(self, config: NodeConfig) -> Asks:
        """Return what one node asks for."""
        return self._node(config)[1]

    def _node(self, config: NodeConfig) -> tuple[Reading, Asks]:
        if config not in self._nodes:
            reading, statements = Reading(), self.accesses.statements(config)
            for statement in statements:
                _statement(reading, config, statement, self.constants)
            decides = config.type.name not in self.unread and not config.is_subtree
            if decides:
                _ports(reading, config)
            self._nodes[config] = reading, self._asked(reading, config, names_in(statements), decides=decides)
        return self._nodes[config]

    def _asked(self, reading: Reading, config: NodeConfig, names: Names, *, decides: bool) -> Asks:
        given = {pointer(one.value, one.name) or one.value for one in config.port_attributes()} if decides else set()
        calls = (part for part in self.accesses.parts(config) if isinstance(part, Call))
        return Asks(
            frozenset(reading.names),
            _keys(config, names.read | names.asked | given),
            _keys(config, names.replaced),
            frozenset(reading.ends),
            reading.asks_first,
            frozenset(name for call in calls if FUNCTIONS[call.function].kind == "skill" for name in call.named),
        )

    def value(self, name: Key, value: object) -> object:
        """Return what the memory keeps of an entry's value."""
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

    def kind(self, name: Key, value: object) -> object:
        """Return a stand-in of the same kind as a value, with which scripts can go on to compute."""
        if isinstance(value, str):
            return ANOTHER
        unknown = UnknownNumber if isinstance(value, int | float) else Unknown
        return unknown(self.oracle, f"`{name[1]}`")

    def _number(self, name: Key, value: float) -> object:
        known = self.numbers.get(name, set())
        low, high = (value.low, value.high) if isinstance(value, UnknownNumber) else (value, value)
        least, most = min(known, default=math.inf), max(known, default=-math.inf)
        if least <= low and high <= most:
            return value
        if low == high and low % 1 == 0 and 0 <= low <= most and low < self.exactly:
            return value
        wide_low = -math.inf if low < least else min(low, math.nextafter(most, math.inf))
        wide_high = math.inf if high > most else max(high, math.nextafter(least, -math.inf))
        return UnknownNumber(self.oracle, f"`{name[1]}`", wide_low, wide_high)


def what_is_read(
    trees: Iterable[NodeConfig],
    opaque: Iterable[str],
    constants: Mapping[str, float],
    oracle: Oracle,
    free: Iterable[str] = (),
    exactly: int = 0,
) -> Read:
    """Return what the trees of a mission, which stand on one blackboard, decide by.

    ``opaque`` are types of node that decide by nothing that is known, ``free`` those that may ask for more than the file shows.
    Entries that are counted are kept exactly below ``exactly``, up to what they are compared with.
    """
    read = Read(oracle=oracle, constants=constants, exactly=exactly, unread=frozenset(opaque), free=frozenset(free))
    for root in trees:
        read.names |= {(root.blackboard, name) for name in OUTCOME}
        for config in root.walk():
            read.add(read.of_node(config))
    read.names |= read.sources(read.names)
    for source, target in [(source, target) for target, sources in read.flows.items() for source in sources]:  # a copy of it
        for one, other in ((source, target), (target, source)):
            read.numbers.setdefault(one, set()).update(read.numbers.get(other, ()))
            read.texts.setdefault(one, set()).update(read.texts.get(other, ()))
            read.whole |= {one} if other in read.whole else set()
            read.ordered |= {one} if other in read.ordered else set()
            read.counted |= {one} if other in read.counted else set()
    return read


def _keys(config: NodeConfig, names: Iterable[str]) -> frozenset[Key]:
    """Return the entries that a node may mean by names."""
    return frozenset(key for name in names for key in config.blackboard.candidates(name))


def _statement(read: Reading, config: NodeConfig, statement: Node, constants: Mapping[str, float]) -> None:
    targets = [one for one in walk(statement) if isinstance(one, Assignment) and isinstance(one.target, Name)]
    for one in targets:
        _assignment(read, config, one)
    inside = {id(part) for one in targets for part in walk(one)}
    read.names |= _keys(config, (one.name for one in walk(statement) if isinstance(one, Name) and id(one) not in inside))
    for node in walk(statement):
        _look(read, config, node, constants)


def _assignment(read: Reading, config: NodeConfig, node: Assignment) -> None:
    sources = _keys(config, (one.name for one in walk(node.value) if isinstance(one, Name)))
    for target in _keys(config, [node.target.name] if isinstance(node.target, Name) else ()):
        if sources or not node.replaces:
            read.flows.setdefault(target, set()).update(sources if node.replaces else {*sources, target})
        if not node.replaces or any(isinstance(one, Chain) for one in walk(node.value)):
            read.counted.add(target)


def _look(read: Reading, config: NodeConfig, node: Node, constants: Mapping[str, float]) -> None:
    if isinstance(node, Call):
        read.asks_first |= node.function == "failed_first"
        read.ends |= set(node.named) if node.function == "failed" else set()
    if isinstance(node, Comparison):
        literals = [one.value for one in node.operands if isinstance(one, Literal)]
        literals += [constants[one.name] for one in node.operands if isinstance(one, Name) and one.name in constants]
        simple = all(isinstance(one, Name | Literal) for one in node.operands)
        for key in _keys(config, (one.name for operand in node.operands for one in walk(operand) if isinstance(one, Name))):
            read.texts.setdefault(key, set()).update(str(one) for one in literals if isinstance(one, str))
            read.numbers.setdefault(key, set()).update(float(one) for one in literals if isinstance(one, int | float))
            if not simple or len(literals) < len(node.operands) - 1 or any(symbol not in {"==", "!="} for symbol in node.operators):
                read.ordered.add(key)


def _ports(read: Reading, config: NodeConfig) -> None:
    keys = _keys(config, (key for one in config.port_attributes() if (key := pointer(one.value, one.name)) is not None))
    read.names |= keys
    read.whole |= keys
