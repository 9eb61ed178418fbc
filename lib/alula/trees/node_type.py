"""Types of node, without any tree: for the reader of files, the factory, the checker, Groot2's palette, drawings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import ClassVar, Protocol

from alula.trees.ends import Ends, Given
from alula.trees.ports import Port
from alula.trees.ticking import ANY_TICKING, Ticking


class Category(Enum):
    """As BehaviorTree.CPP writes them in files."""

    ACTION = "Action"
    CONDITION = "Condition"
    CONTROL = "Control"
    DECORATOR = "Decorator"
    SUBTREE = "SubTree"


CATEGORIES = {category.value: category for category in Category}


class NodeClass(Protocol):
    """What a class of nodes declares before any tree is built; see `node.Node`."""

    @property
    def may_run(self) -> bool | None: ...  # noqa: D102
    @property
    def takes_away(self) -> str: ...  # noqa: D102
    def is_described(self) -> bool: ...  # noqa: D102
    def known_ticking(self) -> Ticking: ...  # noqa: D102
    def may_end(self, given: Given, children: Sequence[Ends]) -> Ends: ...  # noqa: D102
    def never_ticked(self, given: Given, children: Sequence[Ends]) -> Iterator[tuple[int, int]]: ...  # noqa: D102
    def as_type(self, name: str = "") -> NodeType: ...  # noqa: D102


@dataclass(frozen=True)
class NodeType:
    """A type of node as a registry has it; of one that only a model tells of nothing can be ticked, so it can be drawn and checked."""

    is_tickable: ClassVar[bool] = False
    """Whether nodes can be made of it, as of a `node.TickableType`."""

    name: str
    category: Category
    ports: Mapping[str, Port] = field(default_factory=dict)
    doc: str = ""
    children: tuple[int, int | None] = (0, 0)
    """How many it may have, from and to; None: any number."""
    runs: bool | None = None
    """Whether it may take several ticks, where no class tells it; None: nobody knows."""
    tells: NodeClass | None = None
    """The class that tells of its nodes what `described` ones do, though it makes none."""
    assumed: bool = False
    """Nobody has declared it: it is taken for a node that many programs have."""
    unknown: bool = False
    """No registry has it: it may do anything, and read and write any entry."""

    @cached_property
    def scripts(self) -> tuple[str, ...]:
        """The ports that hold a script."""
        return tuple(port.name for port in self.ports.values() if port.script)

    @property
    def teller(self) -> NodeClass | None:
        """The class that describes its nodes, whether or not the description applies to them (see `described`)."""
        return self.tells

    @cached_property
    def described(self) -> NodeClass | None:
        """The class of its nodes where it describes how they end (`Node.is_described`), else None: they may do anything."""
        known = self.teller
        return known if known is not None and known.is_described() else None

    @cached_property
    def ticking(self) -> Ticking:
        """How its nodes tick their children."""
        return self.described.known_ticking() if self.described else ANY_TICKING

    @property
    def may_run(self) -> bool | None:
        """Whether it may answer RUNNING by itself, apart from its children; None: not known. A condition never does."""
        if self.category is Category.CONDITION:
            return False
        return self.described.may_run if self.described else self.runs


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
    return NodeType(name, category, {port.name: port for port in ports}, doc, children or CHILDREN[category])


def unknown_type(name: str) -> NodeType:
    """Return the type of a node that no registry has."""
    return NodeType(name, Category.ACTION, children=(0, None), unknown=True)
