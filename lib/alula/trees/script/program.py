"""A script that was read: what it runs, the names that it uses, and what older and newer BT.CPP read otherwise."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from alula.trees.script.compiler import Code, compile_node
from alula.trees.script.errors import ScriptError
from alula.trees.script.scope import Scope, Unknown, Value
from alula.trees.script.syntax import Assignment, Call, Name, Node, walk
from alula.trees.script.values import ValueMismatch, truth


@dataclass(frozen=True, slots=True)
class Names:
    """The names in a script: entries read and written, those written without being read, what calls name, and functions."""

    read: frozenset[str]
    written: frozenset[str]
    replaced: frozenset[str]
    asked: frozenset[str]
    called: frozenset[str]


@dataclass(frozen=True, slots=True)
class Note:
    """A place that not every BT.CPP 4 reads as it is read here; offsets as in ScriptError."""

    message: str
    offset: int
    end: int
    cure: str


@dataclass(frozen=True)
class Program:
    """A script: its text, statements, and notes about what BT.CPP 4.8 or 4.9 reads otherwise."""

    text: str
    statements: tuple[Node, ...]
    notes: tuple[Note, ...] = ()
    _code: Sequence[Code] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_code", tuple(compile_node(statement) for statement in self.statements))

    def run(self, scope: Scope) -> Value:
        """Run all statements; return the value of the last one. Raise ScriptError; what ran before it stays done."""
        value: Value = None
        for code in self._code:
            value = code(scope)
        return value

    def judge(self, scope: Scope) -> bool | Unknown:
        """Run the script as a condition; raise ScriptError where its value is neither true nor false, nor unknown."""
        value = self.run(scope)
        try:
            return value if isinstance(value, Unknown) else truth(value)
        except ValueMismatch as error:
            last = self.statements[-1]
            raise ScriptError(f"a condition's value: {error}", last.offset, end=last.end, cure=error.cure) from error

    def nodes(self) -> Iterator[Node]:
        """Yield all nodes of the syntax tree."""
        for statement in self.statements:
            yield from walk(statement)

    @property
    def names(self) -> Names:
        """The names that the script uses."""
        return names_in(self.statements)


def names_in(statements: Iterable[Node]) -> Names:
    """Return the names that statements use."""
    nodes = [node for statement in statements for node in walk(statement)]
    assigned = [node for node in nodes if isinstance(node, Assignment)]
    calls = [node for node in nodes if isinstance(node, Call)]
    asked = [argument for node in calls for argument in node.arguments if isinstance(argument, Name)]
    aside = {id(node) for node in (*asked, *(one.target for one in assigned if one.replaces))}
    return Names(
        read=_names(node for node in nodes if id(node) not in aside),
        written=_names(node.target for node in assigned),
        replaced=_names(node.target for node in assigned if node.replaces),
        asked=_names(asked),
        called=frozenset(node.function for node in calls),
    )


def _names(nodes: Iterable[Node]) -> frozenset[str]:
    return frozenset(node.name for node in nodes if isinstance(node, Name))
