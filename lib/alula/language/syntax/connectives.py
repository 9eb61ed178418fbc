"""The grammar that all expressions share: `=>`, `or`, `and`, `not`, `true`, `false` and parentheses, around what a subclass reads.

Conditions of models, properties of models and missions, and formulas of mocks are read by it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Generic, NoReturn, TypeVar

from alula.language.lexer import Token
from alula.language.syntax.cursor import Cursor, SyntaxFault

MAX_DEPTH = 40
"""Nesting beyond this is a mistake or an attack; it also keeps the recursion within Python's limit."""
T = TypeVar("T")


class Connectives(ABC, Generic[T]):
    """Reads one expression; what it is made into is the subclass's.

    From loose to tight: `=>` (to the right), `or`, `and`, `not`, then operands and parentheses.
    """

    def __init__(self, cursor: Cursor) -> None:
        self.cursor = cursor
        self.enclosed = 0
        """In how many parentheses the place is."""

    @abstractmethod
    def implied(self, premise: T, conclusion: T) -> T:
        """Return `premise => conclusion`."""

    @abstractmethod
    def either(self, operands: Sequence[T]) -> T:
        """Return the disjunction of two operands or more."""

    @abstractmethod
    def both(self, operands: Sequence[T]) -> T:
        """Return the conjunction of two operands or more."""

    @abstractmethod
    def negated(self, word: Token, operand: T) -> T:
        """Return the negation; ``word`` is the `not`."""

    @abstractmethod
    def constant(self, word: Token) -> T:
        """Return what the word `true` or `false` stands for."""

    @abstractmethod
    def atom(self, depth: int) -> T:
        """Read what stands between the connectives."""

    def implication(self, depth: int = 0) -> T:
        """Read `premise => conclusion`, which groups to the right."""
        self.limit(depth)
        premise = self._disjunction(depth)
        if not self.cursor.accept("=>"):
            return premise
        return self.implied(premise, self.implication(depth + 1))

    def _disjunction(self, depth: int) -> T:
        operands = [self._conjunction(depth)]
        while self.cursor.accept("or"):
            operands.append(self._conjunction(depth))
        return operands[0] if len(operands) == 1 else self.either(operands)

    def _conjunction(self, depth: int) -> T:
        operands = [self._negation(depth)]
        while self.cursor.accept("and"):
            operands.append(self._negation(depth))
        return operands[0] if len(operands) == 1 else self.both(operands)

    def _negation(self, depth: int) -> T:
        self.limit(depth)
        if token := self.cursor.accept("not"):
            return self.negated(token, self._negation(depth + 1))
        return self.operand(depth)

    def operand(self, depth: int) -> T:
        """Read a constant, what stands in parentheses, or an atom."""
        if token := self.cursor.accept("true", "false"):
            return self.constant(token)
        if self.cursor.at("("):
            return self.parenthesised(depth + 1)
        return self.atom(depth)

    def parenthesised(self, depth: int) -> T:
        """Read `( expression )`."""
        self.cursor.expect("(")
        self.enclosed += 1
        inner = self.implication(depth)
        self.enclosed -= 1
        if not self.cursor.accept(")"):
            raise self.cursor.fail("`)`", "`and`", "`or`", "`=>`")
        return inner

    def limit(self, depth: int) -> None:
        """Refuse an expression that is nested too deep."""
        if depth > MAX_DEPTH:
            self._too_deep()

    def _too_deep(self) -> NoReturn:
        message = f"the condition is nested more than {MAX_DEPTH} deep"
        self.cursor.source.report("ALU105", message, self.cursor.span(self.cursor.here))
        raise SyntaxFault
