"""Whether the conditions of two nodes exclude each other: `_while="mode == 1"` and `_while="mode == 2"`, `_skipIf="x"` and `_while="x"`."""

from __future__ import annotations

import operator
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise, product
from math import prod
from typing import TypeAlias

from alula.check.scripts import Scripts
from alula.trees.node import NodeConfig
from alula.trees.script.syntax import Call, Chain, Comparison, Literal, Name, Node, Prefix

MOST = 4096
"""Combinations of values that are tried."""
NEAR = 0.5
_COMPARES: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne,
}  # fmt: skip
_OTHER = "\0"
Value: TypeAlias = "float | str"
Values: TypeAlias = Mapping[object, Value]


class _Unclear(Exception):  # noqa: N818 - ends an attempt, is no error
    """The conditions say more than comparisons of entries with fixed values."""


@dataclass(frozen=True)
class _Guard:
    """A condition that has to hold, or not to, where it stands."""

    config: NodeConfig
    node: Node
    holds: bool


def exclude(one: NodeConfig, other: NodeConfig, scripts: Scripts, names: Collection[str]) -> bool:
    """Return whether the two can't both begin: whatever values entries have, a condition of one of them is not met."""
    guards = [*_guards(one, scripts), *_guards(other, scripts)]
    if {guard.config for guard in guards} != {one, other}:
        return False
    try:
        domains = _Domains(names)
        for guard in guards:
            domains.add(guard.config, guard.node)
        return not any(all(domains.truth(guard.config, guard.node, values) is guard.holds for guard in guards) for values in domains.all())
    except _Unclear:
        return False


def _guards(config: NodeConfig, scripts: Scripts) -> Iterator[_Guard]:
    for name, holds in (("_while", True), ("_skipIf", False)):
        attribute = config.element.attributes.get(name)
        program = scripts.program(attribute) if attribute else None
        if program is not None and len(program.statements) == 1:
            yield _Guard(config, program.statements[0], holds)


class _Domains:
    """The values that each entry is compared with, and one that is none of them."""

    def __init__(self, names: Collection[str]) -> None:
        self._names = names
        self._values: dict[object, set[Value]] = {}

    def all(self) -> Iterator[Values]:
        """Yield all combinations."""
        if prod(len(values) for values in self._values.values()) > MOST:
            raise _Unclear
        for values in self._values.values():
            if len({isinstance(value, str) for value in values}) > 1:
                raise _Unclear
        for chosen in product(*self._values.values()):
            yield dict(zip(self._values, chosen, strict=True))

    def add(self, config: NodeConfig, node: Node) -> None:
        """Take in a condition."""
        match node:
            case Chain(operators=operators) if set(operators) <= {"&&", "||"}:
                for operand in node.operands:
                    self.add(config, operand)
            case Prefix(operator="!"):
                self.add(config, node.operand)
            case Comparison():
                for left, right in pairwise(node.operands):
                    self._compared(config, left, right)
            case Literal():
                pass
            case _:
                self._values.setdefault(self._key(config, node), set()).update({0.0, 1.0})

    def _compared(self, config: NodeConfig, left: Node, right: Node) -> None:
        fixed = [self._fixed(one) for one in (left, right)]
        for node, value in ((left, fixed[1]), (right, fixed[0])):
            if self._fixed(node) is None:
                if value is None:
                    raise _Unclear
                near: set[Value] = {_OTHER} if isinstance(value, str) else {value - NEAR, value + NEAR}
                self._values.setdefault(self._key(config, node), set()).update({value, *near})

    def truth(self, config: NodeConfig, node: Node, values: Values) -> bool:
        """Return whether a condition holds with these values."""
        match node:
            case Chain():
                answers = [self.truth(config, operand, values) for operand in node.operands]
                return all(answers) if set(node.operators) == {"&&"} else any(answers) if set(node.operators) == {"||"} else self._mixed()
            case Prefix():
                return not self.truth(config, node.operand, values)
            case Comparison():
                known = [self._value(config, operand, values) for operand in node.operands]
                return all(_compare(sign, *pair) for sign, pair in zip(node.operators, pairwise(known), strict=True))
            case _:
                return self._value(config, node, values) != 0.0

    @staticmethod
    def _mixed() -> bool:
        raise _Unclear

    def _value(self, config: NodeConfig, node: Node, values: Values) -> Value:
        fixed = self._fixed(node)
        return values[self._key(config, node)] if fixed is None else fixed

    def _fixed(self, node: Node) -> Value | None:
        if isinstance(node, Literal):
            return node.value if isinstance(node.value, str) else float(node.value)
        return node.name if isinstance(node, Name) and "." not in node.name and node.name in self._names else None

    def _key(self, config: NodeConfig, node: Node) -> object:
        match node:
            case Name(name=name):
                return name if "." in name else config.blackboard.where(name)
            case Call() if all(isinstance(argument, Name) for argument in node.arguments):
                return (node.function, *(argument.name for argument in node.arguments if isinstance(argument, Name)))
            case _:
                raise _Unclear


def _compare(sign: str, left: Value, right: Value) -> bool:
    if isinstance(left, str) or isinstance(right, str):
        if type(left) is not type(right) or sign not in {"==", "!="}:
            raise _Unclear
        return (left == right) == (sign == "==")
    return _COMPARES[sign](left, right)
