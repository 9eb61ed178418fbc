"""Entries of the blackboard: read before anything can have written them, written or read with types or units that don't fit."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

from alula.check.problems import in_value, of_value
from alula.check.scripts import Scripts
from alula.common.suggestions import nearest
from alula.trees.access import scripts_after, scripts_before, scripts_within
from alula.trees.blackboard import Blackboard
from alula.trees.document import Attribute
from alula.trees.errors import Problem
from alula.trees.node import Wiring, pointer
from alula.trees.palette import Direction, Port
from alula.trees.reading import PRECONDITIONS
from alula.trees.script.syntax import Assignment, Call, Chain, Comparison, Conditional, Literal, Name, Node, Prefix, children
from alula.trees.status import SUCCESS
from alula.trees.values import ANY, NUMBERS, STRING, TYPES
from alula.trees.wiring import plain_inside

Key = tuple[Blackboard, str]
"""An entry: the blackboard that it stands on, and its name there."""
NUMBER, TEXT, UNKNOWN = "a number", "a text", ""
"""What a script writes; a port writes what its type is called."""
_NUMERIC = frozenset({NUMBER, *(one.name for one in NUMBERS)})
_ASKED = frozenset(PRECONDITIONS)


@dataclass(frozen=True)
class Use:
    """An entry is read or written, at a place: ``offsets`` in the value of the attribute, None for all of it."""

    key: Key
    name: str
    write: bool
    attribute: Attribute
    offsets: tuple[int, int] | None = None
    type: str = UNKNOWN
    unit: str = ""
    unchecked: str = ""
    """The type of the node that goes on where the entry has no value; empty: what reads it fails then."""

    def problem(self, code: str, message: str, cure: str) -> Problem:
        """Return a problem of this use."""
        if self.offsets is None:
            return of_value(code, self.attribute, message, cure)
        return in_value(code, self.attribute, self.offsets, message, cure)


class Uses:
    """All uses of entries in a tree, in the order in which they may come first."""

    def __init__(self, programs: Scripts, names: Collection[str] = ()) -> None:
        self._programs = programs
        self._names = names
        self._before: dict[Wiring, list[Use]] = {}
        self._after: dict[Wiring, list[Use]] = {}

    def of(self, wiring: Wiring) -> Iterator[Use]:
        """Yield those of a node and all below it."""
        left = [(wiring, False)]
        while left:
            one, is_over = left.pop()
            if is_over:
                yield from self.after(one)
                continue
            yield from self.before(one)
            left.append((one, True))
            left.extend((child, False) for child in reversed(one.children))

    def before(self, wiring: Wiring) -> list[Use]:
        """Return those before its children are ticked, of a leaf those before it ends."""
        if wiring not in self._before:
            self._before[wiring] = list(self._first(wiring))
        return self._before[wiring]

    def after(self, wiring: Wiring) -> list[Use]:
        """Return those of its scripts after it has ended."""
        if wiring not in self._after:
            self._after[wiring] = [use for attribute in scripts_after(wiring.element) for use in self._script(wiring, attribute)]
        return self._after[wiring]

    def _first(self, wiring: Wiring) -> Iterator[Use]:
        for attribute in scripts_before(wiring.element):
            yield from self._script(wiring, attribute)
        if wiring.is_subtree:
            yield from _constants(wiring)
            return
        yield from self._ports(wiring, write=False)
        for attribute in scripts_within(wiring.element, wiring.type):
            yield from self._script(wiring, attribute)
        yield from self._ports(wiring, write=True)

    def _ports(self, wiring: Wiring, *, write: bool) -> Iterator[Use]:
        known = wiring.type.ports
        for attribute in (*wiring.port_attributes(), *_by_default(wiring)):
            port = known.get(attribute.name)
            if port is None:
                continue
            key = pointer(attribute.value, port.name)
            if port.written_from and key is None and write:
                name = attribute.value
                yield Use(wiring.blackboard.where(name), name, True, attribute, None, _set_type(wiring, port.written_from))
            if key is None or not self._uses(wiring, port, write=write) or (port.written_from and write):
                continue
            unchecked = wiring.type.name if port.unchecked and not write else ""
            yield Use(wiring.blackboard.where(key), key, write, attribute, None, _type_name(port), port.unit, unchecked)

    def _uses(self, wiring: Wiring, port: Port, *, write: bool) -> bool:
        """Tell whether a port writes, or else needs what it reads: of one that does both, only a class is known to need it."""
        if write:
            return port.direction is not Direction.INPUT
        needs = port.direction is Direction.INPUT or (port.direction is Direction.INOUT and wiring.type.make is not None)
        return needs and not port.optional

    def _script(self, wiring: Wiring, attribute: Attribute) -> Iterator[Use]:
        program = self._programs.program(attribute)
        for statement in program.statements if program else ():
            yield from self._node(wiring.blackboard, attribute, statement)

    def _node(self, board: Blackboard, attribute: Attribute, node: Node) -> Iterator[Use]:
        match node:
            case Name():
                if node.name not in self._names and "." not in node.name:
                    yield Use(board.where(node.name), node.name, False, attribute, (node.offset, node.end))
            case Assignment(target=Name() as target):
                if not node.replaces:
                    yield from self._node(board, attribute, target)
                yield from self._node(board, attribute, node.value)
                place, kind = (target.offset, target.end), _written(node.value)
                yield Use(board.where(target.name), target.name, True, attribute, place, kind)
            case _:
                for child in children(node):
                    if not (isinstance(node, Call) and isinstance(child, Name)) and not _is_state(node, child):
                        yield from self._node(board, attribute, child)


def _by_default(wiring: Wiring) -> Iterator[Attribute]:
    """Yield the outputs that the file does not give and that the type has an entry for, as if they stood in the file."""
    for port in wiring.type.ports.values():
        if port.direction is not Direction.INPUT and port.default and port.name not in wiring.element.attributes:
            yield Attribute(port.name, port.default, wiring.element.place)


def _is_state(node: Node, child: Node) -> bool:
    """Tell whether a bare name stands beside a dotted one: `navigation.flight_status == IN_AIR`."""
    if not isinstance(node, Comparison) or not isinstance(child, Name):
        return False
    return any(isinstance(other, Name) and "." in other.name for other in node.operands)


def _written(value: Node) -> str:
    """Return what a script's expression gives, as far as it can be told."""
    match value:
        case Literal():
            return TEXT if isinstance(value.value, str) else NUMBER
        case Comparison() | Prefix():
            return NUMBER
        case Chain(operators=operators):
            return TEXT if ".." in operators else UNKNOWN if "+" in operators else NUMBER
        case Conditional():
            then, otherwise = _written(value.then), _written(value.otherwise)
            return then if then == otherwise else UNKNOWN
        case _:
            return UNKNOWN


def _set_type(wiring: Wiring, source: str) -> str:
    text = wiring.ports.get(source) or ""
    if pointer(text, source) is not None:
        return UNKNOWN
    try:
        float(text)
    except ValueError:
        return TEXT
    return UNKNOWN  # a text, which any number's port reads


def _type_name(port: Port) -> str:
    return UNKNOWN if port.type is ANY else port.type.name


def _constants(wiring: Wiring) -> Iterator[Use]:
    """Yield what a subtree's use writes into the entries of the subtree: `<SubTree ID="leg" height="3"/>`."""
    for child in wiring.children:
        for name, text in plain_inside(wiring).items():
            attribute = wiring.element.attributes.get(name) or Attribute(name, text, wiring.element.place)
            yield Use((child.blackboard, name), name, True, attribute)


Writers = dict[Key, Use]
"""What writes entries first, by entry."""


def written(root: Wiring, uses: Uses) -> Writers:
    """Return what first writes each entry of the blackboard that a tree itself stands on."""
    return {key: use for key, use in _written_in(root, uses).items() if key[0] is root.blackboard}


def _written_in(root: Wiring, uses: Uses) -> Writers:
    return {use.key: use for use in reversed(list(uses.of(root))) if use.write}


def read_too_early(root: Wiring, uses: Uses, given: Collection[str], others: Writers, *, late: bool, foreign: bool) -> Iterator[Problem]:
    """Yield each reading of an entry that nothing can have written by then.

    ``given`` is what the blackboard has at the start, ``others`` what another tree writes on it: after this one has begun, or, with
    ``late``, perhaps before.
    """
    by_then = {root.blackboard.where(name) for name in given}
    later = {**others, **_written_in(root, uses)}
    names = sorted({use.name for use in later.values()} | set(given))
    taken: dict[Key, Wiring] = {}

    def visit(wiring: Wiring, *, within: bool = False) -> Iterator[Problem]:
        yield from judged(uses.before(wiring))
        if not within and goes_back(wiring):  # what one writes, any other may find
            within = True
            by_then.update(use.key for child in wiring.children for use in uses.of(child) if use.write)
        unset: set[Key] = set()
        for child in wiring.children:
            yield from visit(child, within=within)
            unset |= {key for key in _unset(wiring, child) if key in by_then}
            by_then.difference_update(unset & set(_unset(wiring, child)))
            taken.update(dict.fromkeys(_unset(wiring, child), child))
        by_then.update(unset)  # behind this node nobody knows whether it came to that
        yield from judged(uses.after(wiring))

    def judged(found: list[Use]) -> Iterator[Problem]:
        for use in found:
            if use.write:
                by_then.add(use.key)
            elif use.key not in by_then:
                by_then.add(use.key)  # one finding for an entry is enough
                if use.key in taken:
                    yield _taken_away(use, taken[use.key])
                elif late and use.key in others:
                    yield replace(_perhaps_unwritten(use, others[use.key]), warning=True)
                else:
                    outside = foreign and use.key not in later and use.key[0] is root.blackboard
                    yield replace(_unwritten(use, later.get(use.key), names), warning=outside or bool(use.unchecked))

    yield from visit(root)


def _perhaps_unwritten(use: Use, writer: Use) -> Problem:
    message = f"`{use.name}` is read, and this tree may begin before line {writer.attribute.place.line} has written it"
    return use.problem("ALU607", message, "have it from the start: an output port of the main tree's model, with a default")


def goes_back(wiring: Wiring) -> bool:
    """Tell whether a child of a node may be ticked after another one that stands behind it."""
    return wiring.ticking.goes_back(len(wiring.children))


def _unset(parent: Wiring, child: Wiring) -> tuple[Key, ...]:
    """Return the entry that a child has surely taken away when the next one's turn comes."""
    port = child.described.takes_away if child.described else ""
    if not port:
        return ()
    key = child.ports.get(port) or ""
    in_order = parent.ticking.lists and parent.ticking.goes_on is SUCCESS
    sure = in_order and not any(goes_back(one) for one, _ in child.above())
    if not sure or pointer(key, port) is not None or _ASKED.intersection(child.element.attributes):
        return ()
    return (child.blackboard.where(key),)


def _taken_away(use: Use, by: Wiring) -> Problem:
    message = f"`{use.name}` is read, and {by.type.name} in line {by.element.place.line} has taken it away"
    return use.problem("ALU607", message, "read it before, or write it again")


def _unwritten(use: Use, writer: Use | None, names: list[str]) -> Problem:
    if writer is not None:
        message = f"`{use.name}` is read here before anything can have written it: line {writer.attribute.place.line} does later"
        return use.problem("ALU607", message, "write it before, or ask for it later")
    message = f"`{use.name}` is read, and nothing before writes it"
    if use.unchecked:
        message = f"`{use.name}` is read, nothing before writes it, and '{use.unchecked}' goes on with an empty one"
    alike = nearest(use.name, names)
    cure = alike if alike.startswith("did you mean") else f'write it before: <Script code="{use.name} := ..."/>'
    return use.problem("ALU607", message, cure)


def mismatched(root: Wiring, uses: Uses) -> Iterator[Problem]:
    """Yield entries that are written with two types, or read as another type or in another unit than they are written."""
    writers: dict[Key, Use] = {}
    readers: list[Use] = []
    for use in uses.of(root):
        if not use.write:
            readers.append(use)
        elif not use.type:
            continue
        elif not _same_type(use.type, writers.setdefault(use.key, use).type):
            first = writers[use.key]
            message = f"`{use.name}` is written as {use.type} here and as {first.type} in line {first.attribute.place.line}"
            yield use.problem("ALU608", message, "an entry keeps its type: write another entry")
    for use in readers:
        known = writers.get(use.key)
        if known is None:
            continue
        line = known.attribute.place.line
        if not _readable(known.type, use.type):
            message = f"`{use.name}` is read as {use.type} and is written as {known.type} in line {line}"
            yield use.problem("ALU605", message, "read an entry of this type")
        elif use.unit and known.unit and use.unit != known.unit:
            message = f"`{use.name}` is read in {use.unit} and is written in {known.unit} in line {line}"
            yield use.problem("ALU606", message, f"convert it in a script, into another entry in {use.unit}")


def _same_type(one: str, other: str) -> bool:
    numbers = NUMBER in {one, other} and {one, other} <= _NUMERIC
    return one == other or numbers or {one, other} == {TEXT, STRING.name}


def _readable(written: str, read: str) -> bool:
    """Tell whether a value goes into a port: numbers and texts are converted as it is read, others have to be of its type."""
    basic = {*TYPES, NUMBER, TEXT, UNKNOWN}
    return written == read or not written or not read or (written in basic and read in basic)
