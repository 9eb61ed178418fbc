"""What anything in a mission decides by: of entries and failures that nothing asks, or only in one way, the search keeps no more."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from alula.missions.filed.plan import DEGRADED, STOPPING
from alula.prove.mission.oracle import Oracle
from alula.prove.mission.unknown import UNKNOWN, UnknownNumber, UnknownText
from alula.trees.document import Element
from alula.trees.node import pointer
from alula.trees.reading import POSTCONDITIONS, PRECONDITIONS, TreeFiles, is_port, type_name
from alula.trees.script import ScriptError, parse
from alula.trees.script.syntax import Assignment, Call, Chain, Comparison, Literal, Name, Node, walk

ANOTHER = "(another text)"
SCRIPT_PORTS = ("code", "if", "otherwise")


@dataclass
class Read:
    """What is read of a mission's memory.

    ``names``: entries that scripts or nodes decide by; ``numbers``, ``texts``: what each of them is compared with; ``counted``: those
    that are computed, perhaps without end; ``whole``: those of which every value counts; ``ends``: those that are asked with ``failed``.
    """

    oracle: Oracle
    names: set[str] = field(default_factory=lambda: {DEGRADED, STOPPING})
    numbers: dict[str, set[float]] = field(default_factory=dict)
    texts: dict[str, set[str]] = field(default_factory=dict)
    counted: set[str] = field(default_factory=set)
    whole: set[str] = field(default_factory=set)
    ordered: set[str] = field(default_factory=set)
    """Entries that are compared with more than literals: of a text every letter counts."""
    ends: set[str] = field(default_factory=set)
    asks_first: bool = False

    def value(self, name: str, value: object) -> object:
        """Return what is kept of an entry's value."""
        if value is None:
            return None
        if name not in self.names:  # of its kind all the same, so that scripts can go on to write it
            number = isinstance(value, int | float)
            return UnknownNumber(self.oracle, f"`{name}`") if number else ANOTHER if isinstance(value, str) else UNKNOWN
        if name in self.whole or (isinstance(value, str) and name in self.ordered):
            return value
        if isinstance(value, UnknownText):
            return value
        if isinstance(value, str):
            return value if value in self.texts.get(name, ()) else ANOTHER
        if isinstance(value, int | float) and not isinstance(value, bool) and name in self.counted:
            return self._number(name, value)
        return value

    def _number(self, name: str, value: float) -> object:
        known = self.numbers.get(name, set())
        low, high = (value.low, value.high) if isinstance(value, UnknownNumber) else (value, value)
        least, most = min(known, default=math.inf), max(known, default=-math.inf)
        if least <= low and high <= most:
            return value
        wide_low = -math.inf if low < least else min(low, math.nextafter(most, math.inf))
        wide_high = math.inf if high > most else max(high, math.nextafter(least, -math.inf))
        return UnknownNumber(self.oracle, f"`{name}`", wide_low, wide_high)


def what_is_read(files: TreeFiles, opaque: Iterable[str], constants: Mapping[str, float], oracle: Oracle) -> Read:
    """Return what the trees of a mission decide by; ``opaque`` are types of node that decide by nothing that is known."""
    read = Read(oracle)
    unread = frozenset(opaque)
    flows: set[tuple[str, str]] = set()
    for tree in files.trees.values():
        for element in tree.iterate():
            for text in _scripts(element):
                _script(read, flows, text, constants)
            _ports(read, flows, element, unread)
    while True:
        more = {source for source, target in flows if target in read.names} - read.names
        if not more:
            break
        read.names |= more
    for source, target in flows:  # one entry under two names, or a copy of it
        for one, other in ((source, target), (target, source)):
            read.numbers.setdefault(one, set()).update(read.numbers.get(other, ()))
            read.texts.setdefault(one, set()).update(read.texts.get(other, ()))
            read.whole |= {one} if other in read.whole else set()
            read.ordered |= {one} if other in read.ordered else set()
            read.counted |= {one} if other in read.counted else set()
    return read


def _scripts(element: Element) -> Iterator[str]:
    for name in (*PRECONDITIONS, *POSTCONDITIONS, *SCRIPT_PORTS):
        if name in element.attributes and not element.get(name).lstrip().startswith("{"):
            yield element.get(name)


def _script(read: Read, flows: set[tuple[str, str]], text: str, constants: Mapping[str, float]) -> None:
    try:
        program = parse(text)
    except ScriptError:
        return
    for statement in program.statements:
        targets = [one for one in walk(statement) if isinstance(one, Assignment) and isinstance(one.target, Name)]
        for one in targets:
            _assignment(read, flows, one)
        inside = {id(part) for one in targets for part in walk(one)}
        read.names |= {_bare(one.name) for one in walk(statement) if isinstance(one, Name) and id(one) not in inside}
        for node in walk(statement):
            _look(read, node, constants)


def _assignment(read: Read, flows: set[tuple[str, str]], node: Assignment) -> None:
    target = _bare(node.target.name) if isinstance(node.target, Name) else ""
    sources = {_bare(one.name) for one in walk(node.value) if isinstance(one, Name)}
    flows |= {(source, target) for source in sources}
    if node.operator not in {":=", "="}:
        flows.add((target, target))
    if node.operator not in {":=", "="} or any(isinstance(one, Chain) for one in walk(node.value)):
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


def _ports(read: Read, flows: set[tuple[str, str]], element: Element, unread: frozenset[str]) -> None:
    kind = type_name(element)
    for name, attribute in element.attributes.items():
        key = pointer(attribute.value, name) if is_port(name) else None
        if key is None:
            continue
        if element.tag == "SubTree":
            flows |= {(_bare(key), name), (name, _bare(key))}
        elif kind not in unread:
            read.names.add(_bare(key))
            read.whole.add(_bare(key))


def _bare(name: str) -> str:
    return name.removeprefix("@")
