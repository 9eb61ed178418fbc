"""A script's syntax tree. Every node knows the place of its text: ``offset`` and ``end``, in characters, ``end`` exclusive."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Literal:
    """A number, a text, or `true` and `false`, which BT.CPP reads as 1 and 0."""

    value: float | str
    offset: int
    end: int


@dataclass(frozen=True, slots=True)
class Name:
    """An entry, an enum's name, or a dotted name."""

    name: str
    offset: int
    end: int


@dataclass(frozen=True, slots=True)
class Call:
    """`function(argument, ...)`, an extension of ours."""

    function: str
    arguments: tuple[Node, ...]
    offset: int
    end: int

    @property
    def named(self) -> tuple[str, ...]:
        """What the arguments name, each as a name or as a text; empty for one that is neither."""
        return tuple(one.name if isinstance(one, Name) else str(one.value) if isinstance(one, Literal) else "" for one in self.arguments)


@dataclass(frozen=True, slots=True)
class Prefix:
    """`-x`, `~x`, `!x`."""

    operator: str
    operand: Node
    offset: int
    end: int


@dataclass(frozen=True, slots=True)
class Chain:
    """Operators of one level, read from the left: `a + b - c`; flat, so that a long sum is no deep tree. ``places``: the operators'."""

    operators: tuple[str, ...]
    operands: tuple[Node, ...]
    places: tuple[int, ...]
    offset: int
    end: int


@dataclass(frozen=True, slots=True)
class Comparison:
    """`a < b <= c`: every two neighbours are compared, up to the first that fail."""

    operators: tuple[str, ...]
    operands: tuple[Node, ...]
    places: tuple[int, ...]
    offset: int
    end: int


@dataclass(frozen=True, slots=True)
class Conditional:
    """`condition ? then : otherwise`."""

    condition: Node
    then: Node
    otherwise: Node
    offset: int
    end: int


@dataclass(frozen=True, slots=True)
class Assignment:
    """`target := value`, `=`, `+=`, `-=`, `*=`, `/=`."""

    operator: str
    target: Node
    value: Node
    offset: int
    end: int

    @property
    def replaces(self) -> bool:
        """Return whether the value takes the place of the entry's, which is not read."""
        return self.operator in {":=", "="}


Node: TypeAlias = Literal | Name | Call | Prefix | Chain | Comparison | Conditional | Assignment


def children(node: Node) -> tuple[Node, ...]:
    """Return the nodes directly below this one, in the order of their evaluation."""
    match node:
        case Call():
            return node.arguments
        case Prefix():
            return (node.operand,)
        case Chain() | Comparison():
            return node.operands
        case Conditional():
            return (node.condition, node.then, node.otherwise)
        case Assignment():
            return (node.value, node.target)
        case _:
            return ()


def walk(node: Node) -> Iterator[Node]:
    """Yield a node and all below it."""
    yield node
    for child in children(node):
        yield from walk(child)
