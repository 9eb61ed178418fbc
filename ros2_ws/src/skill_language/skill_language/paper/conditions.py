"""Conditions: `resource = (a == S and not b != T)`, `data = (battery.level > 0.2)`, and both joined by and, or, not, =>.

From loose to tight: `=>` (to the right), `or`, `and`, `not`, then comparisons and parentheses.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

from skill_language.lexer import Kind, number, string_value
from skill_language.model import And, Comparison, Constant, DataIs, Expression, Implies, Not, Or, ResourceIs, Span
from skill_language.paper.cursor import OPERATOR_WORDS, Cursor, SyntaxFault

MAX_DEPTH = 40
"""Nesting beyond this is a mistake or an attack; it also keeps the recursion within Python's limit."""

Atom = Callable[[int], Expression]


def condition(cursor: Cursor) -> Expression:
    """Read a condition as it stands behind `name:` in a precondition or invariant."""
    return _Reader(cursor).implication(0)


class _Reader:
    """Reads one condition; ``atom`` changes with where we are: outside, in `resource = (...)` or in `data = (...)`."""

    def __init__(self, cursor: Cursor) -> None:
        self.cursor = cursor
        self.atom: Atom = self._predicate

    def implication(self, depth: int) -> Expression:
        """Read `premise => conclusion`, which groups to the right."""
        if depth > MAX_DEPTH:
            self._too_deep()
        premise = self._disjunction(depth)
        if not self.cursor.accept("=>"):
            return premise
        return Implies(premise, self.implication(depth + 1), span=_span(premise))

    def _disjunction(self, depth: int) -> Expression:
        operands = [self._conjunction(depth)]
        while self.cursor.accept("or"):
            operands.append(self._conjunction(depth))
        return operands[0] if len(operands) == 1 else Or(tuple(operands), span=_span(operands[0]))

    def _conjunction(self, depth: int) -> Expression:
        operands = [self._negation(depth)]
        while self.cursor.accept("and"):
            operands.append(self._negation(depth))
        return operands[0] if len(operands) == 1 else And(tuple(operands), span=_span(operands[0]))

    def _negation(self, depth: int) -> Expression:
        if depth > MAX_DEPTH:
            self._too_deep()
        if token := self.cursor.accept("not"):
            return Not(self._negation(depth + 1), span=self.cursor.span(token))
        if token := self.cursor.accept("true", "false"):
            return Constant(token.text == "true", span=self.cursor.span(token))
        if self.cursor.at("("):
            return self._parenthesised(depth + 1)
        return self.atom(depth)

    def _parenthesised(self, depth: int) -> Expression:
        self.cursor.expect("(")
        inner = self.implication(depth)
        self._close()
        return inner

    def _close(self) -> None:
        if not self.cursor.accept(")"):
            raise self.cursor.fail("`)`", "`and`", "`or`", "`=>`")

    def _predicate(self, depth: int) -> Expression:
        """Read `resource = (...)` or `data = (...)`."""
        if not self.cursor.at("resource", "data"):
            raise self.cursor.fail("`resource`", "`data`", "`not`", "`(`", hint=self._predicate_hint())
        word = self.cursor.advance()
        self.cursor.expect("=", hint=f"a condition is written `{word.text} = (...)`")
        outside, self.atom = self.atom, (self._resource_atom if word.text == "resource" else self._data_atom)
        try:
            return self._parenthesised(depth + 1)
        finally:
            self.atom = outside

    def _predicate_hint(self) -> str:
        if self.cursor.ahead().text in {"==", "!="}:
            return "put it into `resource = (...)`, or `data = (...)` if it is about data"
        return ""

    def _resource_atom(self, _depth: int) -> Expression:
        first = self.cursor.name("a resource")
        if self.cursor.at("=") and self.cursor.ahead().kind is Kind.NAME:
            raise self.cursor.fail("`==`", "`!=`", hint="states are compared with `==`")
        operator = self.cursor.expect("==", "!=")
        state = self.cursor.name("a state")
        return ResourceIs(first.text, state.text, operator.text == "!=", span=self.cursor.span(first, state))

    def _data_atom(self, _depth: int) -> Expression:
        first = self.cursor.name("data")
        path: list[str] = []
        while self.cursor.accept("."):
            path.append(self.cursor.name("a field").text)
        last = self.cursor.previous
        if not self.cursor.at(*(c.value for c in Comparison)):
            # A truth value may stand alone.
            return DataIs(first.text, tuple(path), Comparison.EQ, value=True, span=self.cursor.span(first, last))
        comparison = Comparison(self.cursor.advance().text)
        value, unit = self._value()
        span = self.cursor.span(first, self.cursor.previous)
        return DataIs(first.text, tuple(path), comparison, value, unit, span=span)

    def _value(self) -> tuple[float | str | bool, str]:
        cursor = self.cursor
        if token := cursor.accept("true", "false"):
            return token.text == "true", ""
        token = cursor.here
        if token.kind is Kind.STRING:
            return string_value(cursor.advance()), ""
        if token.kind is not Kind.NUMBER:
            raise cursor.fail("a number", 'a string in `"`', "`true`", "`false`")
        value, unit = number(cursor.source, cursor.advance()), cursor.here
        if cursor.at("%") or (unit.kind is Kind.NAME and unit.text not in OPERATOR_WORDS):
            return value, cursor.advance().text + self._per()
        return value, ""

    def _per(self) -> str:
        """Read the second half of a unit such as `m/s`, if it has one."""
        return f"/{self.cursor.name('a unit').text}" if self.cursor.accept("/") else ""

    def _too_deep(self) -> NoReturn:
        message = f"the condition is nested more than {MAX_DEPTH} deep"
        self.cursor.source.report("ALU105", message, self.cursor.span(self.cursor.here))
        raise SyntaxFault


def _span(expression: Expression) -> Span:
    return expression.span
