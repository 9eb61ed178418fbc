"""The types of node that a tree may have, without any tree: for the factory, the checker, Groot2's palette, drawings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, TypeGuard

from alula.common.public import public
from alula.trees.errors import Place
from alula.trees.ticking import ANY_TICKING, Ticking
from alula.trees.values import ANY, STRING, PortType

if TYPE_CHECKING:
    from alula.trees.node import Node, Wiring


class Category(Enum):
    """As BehaviorTree.CPP writes them in files."""

    ACTION = "Action"
    CONDITION = "Condition"
    CONTROL = "Control"
    DECORATOR = "Decorator"
    SUBTREE = "SubTree"


CATEGORIES = {category.value: category for category in Category}


class Direction(Enum):
    """Whether a port is read, written, or both; as in a TreeNodesModel."""

    INPUT = "input_port"
    OUTPUT = "output_port"
    INOUT = "inout_port"


@public("alula.trees")
@dataclass(frozen=True)
class Port:
    """A port: ``default`` is text as in a file, None where there is none; ``unit`` is of a number, as ``m/s``."""

    name: str
    type: PortType = ANY
    direction: Direction = Direction.INPUT
    default: str | None = None
    doc: str = ""
    unit: str = ""
    required: bool = False
    """A file has to give it; else a node does without it, or says so when it is ticked."""
    optional: bool = False
    """The node does without it, and without a value of the entry that it names."""
    unchecked: bool = False
    """The node reads it without looking whether there is a value: it goes on with an empty one."""
    script: bool = False
    """Its text is a script, unless it names an entry that has one."""
    may_be_empty: bool = False
    """A script that is empty does nothing; another node's is wrong then."""
    written_from: str = ""
    """A plain text names an entry, too, which gets what this other port says; empty: a plain text is a value."""
    place: Place | None = field(default=None, compare=False, repr=False)
    """Where a file says its default."""


@public("alula.trees")
def input_port(
    name: str, type_: PortType = ANY, default: str | None = None, doc: str = "", *, unit: str = "", optional: bool = False
) -> Port:
    """Return a port that is read."""
    return Port(name, type_, Direction.INPUT, default, doc, unit, optional=optional)


@public("alula.trees")
def output_port(name: str, type_: PortType = ANY, default: str | None = None, doc: str = "", *, unit: str = "") -> Port:
    """Return a port that is written; it has to name an entry of the blackboard."""
    return Port(name, type_, Direction.OUTPUT, default, doc, unit)


@public("alula.trees")
def inout_port(name: str, type_: PortType = ANY, default: str | None = None, doc: str = "", *, unit: str = "") -> Port:
    """Return a port that is read and written."""
    return Port(name, type_, Direction.INOUT, default, doc, unit)


@public("alula.trees")
def script_port(name: str, doc: str = "", *, may_be_empty: bool = False) -> Port:
    """Return a port whose text is a script, which `Node.script` compiles: what it reads and writes is known before it is run."""
    return Port(name, STRING, doc=doc, script=True, may_be_empty=may_be_empty)


@dataclass(frozen=True)
class NodeType:
    """A type of node: ``make`` makes a node of its wiring (None: known from a model only, so it can be drawn and checked)."""

    name: str
    category: Category
    ports: Mapping[str, Port] = field(default_factory=dict)
    doc: str = ""
    make: Callable[[Wiring], Node] | None = None
    children: tuple[int, int | None] = (0, 0)
    """How many it may have, from and to; None: any number."""
    runs: bool | None = None
    """Whether it may take several ticks, where no class tells it; None: nobody knows."""
    tells: type[Node] | None = None
    """The class that tells of its nodes what `described` ones do, though it makes none."""
    assumed: bool = False
    """Nobody has declared it: it is taken for a node that many programs have."""
    unknown: bool = False
    """No palette has it: it may do anything, and read and write any entry."""

    @cached_property
    def scripts(self) -> tuple[str, ...]:
        """The ports that hold a script."""
        return tuple(port.name for port in self.ports.values() if port.script)

    @cached_property
    def described(self) -> type[Node] | None:
        """The class of its nodes where that tells how they end (`Node.is_described`), else None: they may do anything."""
        known = self.tells or self.make
        return known if _is_class(known) and known.is_described() else None

    @cached_property
    def ticking(self) -> Ticking:
        """How its nodes tick their children."""
        return self.described.known_ticking() if self.described else ANY_TICKING

    @property
    def may_run(self) -> bool | None:
        """Whether it may take several ticks, its children aside; None: not known. A condition answers at once."""
        if self.category is Category.CONDITION:
            return False
        return self.described.may_run if self.described else self.runs

    def wired(self, wiring: Wiring) -> Node:
        """Make a node, ready to be ticked; raises FileError."""
        if self.make is None:
            msg = f"{self.name} is known from a model only, there is nothing to tick"
            raise TypeError(msg)
        node = self.make(wiring)
        node.setup()
        return node


def _is_class(make: object) -> TypeGuard[type[Node]]:
    return isinstance(make, type)


CHILDREN: Mapping[Category, tuple[int, int | None]] = {
    Category.ACTION: (0, 0),
    Category.CONDITION: (0, 0),
    Category.CONTROL: (1, None),
    Category.DECORATOR: (1, 1),
    Category.SUBTREE: (0, 0),
}


def node_type(
    name: str, category: Category, ports: Iterable[Port] = (), *, doc: str = "", children: tuple[int, int | None] | None = None
) -> NodeType:
    """Return a type that nothing can be made of yet, with the number of children that its category has."""
    return NodeType(name, category, {port.name: port for port in ports}, doc, None, children or CHILDREN[category])


def unknown_type(name: str) -> NodeType:
    """Return the type of a node that no palette has."""
    return NodeType(name, Category.ACTION, children=(0, None), unknown=True)


def name_in_files(node: type[Node]) -> str:
    """Return what files call a class of nodes."""
    own = vars(node).get("registered_name", "")  # that of a base is the base's
    return str(own) or node.__name__


class Palette:
    """Types of node by their names."""

    def __init__(self, types: Iterable[NodeType] = ()) -> None:
        self._types: dict[str, NodeType] = {}
        for one in types:
            self.add(one)

    def add(self, one: NodeType) -> None:
        """Add a type; a name is given once only, unless the one before was known from a model only."""
        known = self._types.get(one.name)
        if known is not None and known.make is not None:
            msg = f"the node {one.name} is registered already"
            raise ValueError(msg)
        self._types[one.name] = one

    def register(self, make: type[Node], name: str = "") -> NodeType:
        """Add a class of one's own, whose ports are what it declares, under a name: as it was registered unless another is given."""
        doc = (make.__doc__ or "").strip().partition("\n")[0]
        ports = {port.name: port for port in make.ports}
        one = NodeType(name or name_in_files(make), make.category, ports, doc, make, make.child_count or CHILDREN[make.category])
        self.add(one)
        return one

    def get(self, name: str) -> NodeType | None:
        """Return a type, None where there is none of that name."""
        return self._types.get(name)

    def names(self) -> list[str]:
        """Return all names."""
        return list(self._types)

    def __iter__(self) -> Iterator[NodeType]:
        return iter(self._types.values())

    def __or__(self, other: Palette) -> Palette:
        """Return one with the types of both."""
        return Palette([*self, *other])
