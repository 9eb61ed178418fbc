"""What a node reads and writes: the scripts that its element holds, and the entries that its ports name.

The check of files and the search of all runs both read it here. What is in a script, its `Program` tells.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from alula.trees.attributes import POSTCONDITIONS, PRECONDITIONS
from alula.trees.blackboard import Blackboard
from alula.trees.configuration import plain_inside
from alula.trees.document import Attribute, Element
from alula.trees.node import Node, NodeConfig, pointer
from alula.trees.node_type import NodeType
from alula.trees.ports import Direction, Port
from alula.trees.script.syntax import Assignment, Call, Chain, Comparison, Conditional, Literal, Name, Prefix, children, walk
from alula.trees.script.syntax import Node as Part
from alula.trees.values import ANY

Key: TypeAlias = tuple[Blackboard, str]
"""An entry: the blackboard that it stands on, and its name there."""
NUMBER, TEXT, UNKNOWN = "a number", "a text", ""
"""What a script writes; a port writes what its type is called."""


@dataclass(frozen=True)
class Access:
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
    needed: bool = True
    """Of a reading: the node does not do without."""
    in_passing: bool = False
    """Of a reading: it is read only to be written anew, as in `n += 1`."""
    value: Part | None = None
    """What a script writes."""
    sure: bool = True
    """Of a writing: it comes whenever the script runs, or the node ends."""
    among: frozenset[str] | None = None
    """Of a reading: it is only asked whether the entry is one of these texts; None: its value counts."""


class Accesses:
    """All accesses to entries in a tree, in the order in which they may come first.

    ``statements`` reads the script in an attribute; ``names`` stand in scripts for something else than an entry, such as enums and states,
    and so do dotted names. None: any name may be an entry's.
    """

    def __init__(self, statements: Callable[[Attribute], Sequence[Part]], names: Collection[str] | None = ()) -> None:
        self._statements = statements
        self._names = names
        self._before: dict[NodeConfig, list[Access]] = {}
        self._after: dict[NodeConfig, list[Access]] = {}
        self._scripts: dict[tuple[NodeConfig, str], list[Access]] = {}
        self._read: dict[tuple[NodeConfig, str], Sequence[Part]] = {}

    def of(self, config: NodeConfig) -> Iterator[Access]:
        """Yield those of a node and all below it."""
        left = [(config, False)]
        while left:
            one, is_over = left.pop()
            if is_over:
                yield from self.after(one)
                continue
            yield from self.before(one)
            left.append((one, True))
            left.extend((child, False) for child in reversed(one.children))

    def before(self, config: NodeConfig) -> list[Access]:
        """Return those before its children are ticked, of a leaf those before it ends."""
        if config not in self._before:
            self._before[config] = list(self._first(config))
        return self._before[config]

    def after(self, config: NodeConfig) -> list[Access]:
        """Return those of its scripts after it has ended."""
        if config not in self._after:
            self._after[config] = [one for attribute in scripts_after(config.element) for one in self.in_script(config, attribute.name)]
        return self._after[config]

    def in_script(self, config: NodeConfig, attribute: str) -> list[Access]:
        """Return those of the script in an attribute of a node, none where it has none."""
        key = (config, attribute)
        if key not in self._scripts:
            script = config.element.attributes.get(attribute)
            self._scripts[key] = [] if script is None else list(self._in(config, script))
        return self._scripts[key]

    def in_scripts(self, config: NodeConfig) -> Iterator[Access]:
        """Yield those of all scripts of a node, in the order in which these run."""
        for attribute in scripts_of(config.element, config.type):
            yield from self.in_script(config, attribute.name)

    def statements(self, config: NodeConfig) -> list[Part]:
        """Return the statements of all scripts of a node, in the order in which these run."""
        return [one for attribute in scripts_of(config.element, config.type) for one in self._statements_in(config, attribute)]

    def parts(self, config: NodeConfig) -> Iterator[Part]:
        """Yield the parts of all scripts of a node, in the order in which these run; each before what it is made of."""
        for statement in self.statements(config):
            yield from walk(statement)

    def calls(self, config: NodeConfig, attribute: str) -> Iterator[Call]:
        """Yield the calls in the script in an attribute of a node."""
        script = config.element.attributes.get(attribute)
        for statement in () if script is None else self._statements_in(config, script):
            yield from (one for one in walk(statement) if isinstance(one, Call))

    def of_node(self, config: NodeConfig) -> Iterator[Access]:
        """Yield those of a node itself."""
        yield from self.before(config)
        yield from self.after(config)

    def _first(self, config: NodeConfig) -> Iterator[Access]:
        for attribute in scripts_before(config.element):
            yield from self.in_script(config, attribute.name)
        if config.is_subtree:
            yield from _constants(config)
            return
        yield from _read_by_ports(config)
        for attribute in scripts_within(config.element, config.type):
            yield from self.in_script(config, attribute.name)
        yield from _written_by_ports(config)

    def _statements_in(self, config: NodeConfig, script: Attribute) -> Sequence[Part]:
        key = (config, script.name)
        if key not in self._read:
            self._read[key] = self._statements(script)
        return self._read[key]

    def _in(self, config: NodeConfig, script: Attribute) -> Iterator[Access]:
        for statement in self._statements_in(config, script):
            yield from self._part(config.blackboard, script, statement, sure=True)

    def _is_entry(self, name: str) -> bool:
        return self._names is None or (name not in self._names and "." not in name)

    def _part(
        self,
        board: Blackboard,
        attribute: Attribute,
        part: Part,
        *,
        needed: bool = True,
        sure: bool = False,
        among: frozenset[str] | None = None,
    ) -> Iterator[Access]:
        match part:
            case Name():
                if self._is_entry(part.name):
                    place = (part.offset, part.end)
                    yield Access(board.where(part.name), part.name, False, attribute, place, needed=needed, among=among)
            case Assignment(target=Name() as target):
                key, place = board.where(target.name), (target.offset, target.end)
                if not part.replaces and self._is_entry(target.name):
                    yield Access(key, target.name, False, attribute, place, in_passing=True)
                yield from self._part(board, attribute, part.value)
                yield Access(key, target.name, True, attribute, place, _written(part.value), value=part.value, sure=sure)
            case Assignment(target=Conditional() as target):  # it is written where the condition says
                yield from self._part(board, attribute, target.condition)
                for branch in (target.then, target.otherwise):
                    yield from (one if one.write else replace(one, in_passing=True) for one in self._part(board, attribute, branch))
                yield from self._part(board, attribute, part.value)
            case _:
                texts = among or _among(part)
                for child in children(part):
                    if not (isinstance(part, Call) and isinstance(child, Name)):
                        yield from self._part(board, attribute, child, needed=not _may_be_state(part, child), among=texts)


def _read_by_ports(config: NodeConfig) -> Iterator[Access]:
    for attribute, port in _ports(config):
        key = pointer(attribute.value, port.name)
        if key is not None and port.direction is not Direction.OUTPUT:
            # Of a port that is read and written, only a class is known to need what it reads.
            needed = not port.optional and (port.direction is Direction.INPUT or config.type.is_tickable)
            unchecked = config.type.name if port.unchecked else ""
            yield Access(config.blackboard.where(key), key, False, attribute, None, _type_name(port), port.unit, unchecked, needed)


def _written_by_ports(config: NodeConfig) -> Iterator[Access]:
    for attribute, port in _ports(config):
        key = pointer(attribute.value, port.name)
        if port.written_from and key is None:
            name = attribute.value
            yield Access(config.blackboard.where(name), name, True, attribute, None, _set_type(config, port.written_from))
        elif key is not None and not port.written_from and port.direction is not Direction.INPUT:
            yield Access(config.blackboard.where(key), key, True, attribute, None, _type_name(port), port.unit)


def _ports(config: NodeConfig) -> Iterator[tuple[Attribute, Port]]:
    """Yield the ports that its type has and its element gives, then outputs that it has an entry for by default."""
    known = config.type.ports
    yield from ((one, known[one.name]) for one in config.port_attributes() if one.name in known)
    for port in known.values():
        if port.direction is not Direction.INPUT and port.default and port.name not in config.element.attributes:
            yield Attribute(port.name, port.default, config.element.place), port


def scripts_before(element: Element) -> Iterator[Attribute]:
    """Yield the attributes whose scripts run before the node is ticked."""
    return _present(element, PRECONDITIONS)


def scripts_within(element: Element, type_: NodeType | None) -> Iterator[Attribute]:
    """Yield the attributes whose scripts are the node's own; not those that name an entry, and not the empty ones that do nothing."""
    for attribute in _present(element, () if type_ is None else type_.scripts):
        may_be_empty = type_ is not None and type_.ports[attribute.name].may_be_empty
        if not _is_in_entry(attribute) and (attribute.value or not may_be_empty):
            yield attribute


def scripts_after(element: Element) -> Iterator[Attribute]:
    """Yield the attributes whose scripts run after the node has ended."""
    return _present(element, POSTCONDITIONS)


def scripts_of(element: Element, type_: NodeType | None) -> Iterator[Attribute]:
    """Yield the attributes with scripts, in the order in which these run; ``type_`` is None for a subtree and an unknown node."""
    yield from scripts_before(element)
    yield from scripts_within(element, type_)
    yield from scripts_after(element)


def takes_script_from_entry(element: Element, type_: NodeType | None) -> bool:
    """Return whether a node runs a script that an entry holds: it may read and write anything."""
    return any(_is_in_entry(attribute) for attribute in _present(element, () if type_ is None else type_.scripts))


def named_entries(node: Node) -> Mapping[str, str]:
    """Return the entries that a node's ports name, by port, as the file calls them: ``@entry`` is one of the main tree."""
    keys = ((port, pointer(text, port)) for port, text in node.config.ports.items())
    return {port: key for port, key in keys if key is not None}


def written_entries(node: Node) -> Mapping[str, str]:
    """Return the entries that a node may write through its ports, by port; as `named_entries`."""
    known = node.config.type.ports
    return {port: key for port, key in named_entries(node).items() if port in known and known[port].direction is not Direction.INPUT}


def _is_in_entry(attribute: Attribute) -> bool:
    return attribute.value.lstrip().startswith("{")


def _present(element: Element, names: tuple[str, ...]) -> Iterator[Attribute]:
    return (element.attributes[name] for name in names if name in element.attributes)


def _among(part: Part) -> frozenset[str] | None:
    """Return the texts of a condition that asks only whether one entry is one of them; None where it is no such condition."""
    match part:
        case Comparison(operands=(Name(), Literal(value=str(text))), operators=("==" | "!=",)):
            return frozenset({text})
        case Chain(operators=operators, operands=operands) if set(operators) == {"||"}:
            texts = [_among(one) for one in operands if isinstance(one, Comparison) and one.operators == ("==",)]
            names = {one.operands[0].name for one in operands if isinstance(one, Comparison) and isinstance(one.operands[0], Name)}
            known = [one for one in texts if one is not None]
            return frozenset().union(*known) if len(known) == len(operands) and len(names) == 1 else None
    return None


def _may_be_state(part: Part, child: Part) -> bool:
    """Return whether a bare name stands beside a dotted one: `navigation.flight_status == IN_AIR`."""
    if not isinstance(part, Comparison) or not isinstance(child, Name):
        return False
    return any(isinstance(other, Name) and "." in other.name for other in part.operands)


def _written(value: Part) -> str:
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


def _set_type(config: NodeConfig, source: str) -> str:
    text = config.ports.get(source) or ""
    if pointer(text, source) is not None:
        return UNKNOWN
    try:
        float(text)
    except ValueError:
        return TEXT
    return UNKNOWN  # a text, which any number's port reads


def _type_name(port: Port) -> str:
    return UNKNOWN if port.type is ANY else port.type.name


def _constants(config: NodeConfig) -> Iterator[Access]:
    """Yield what a subtree's use writes into the entries of the subtree: `<SubTree ID="leg" height="3"/>`."""
    for child in config.children:
        for name, text in plain_inside(config).items():
            attribute = config.element.attributes.get(name) or Attribute(name, text, config.element.place)
            yield Access((child.blackboard, name), name, True, attribute)
