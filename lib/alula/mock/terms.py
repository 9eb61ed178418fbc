"""Read formulas of behaviour files: conditions of the skill language between terms with arithmetic.

From loose to tight: `a if condition else b`, the language's `=>`, `or`, `and`, `not`, a comparison, `+ -`, `* /`, a sign, and then
numbers with or without a unit, strings, lists, names with their fields and elements, functions.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from alula.common.located_yaml import choices
from alula.language.lexer import Kind, Source, Token, number, string_value
from alula.language.syntax.connectives import Connectives
from alula.language.syntax.cursor import OPERATOR_WORDS, Cursor, SyntaxFault
from alula.model.span import Span
from alula.model.units import UNIT_IN_SI

Names = Mapping[str, object]
Functions = Mapping[str, Callable[..., object]]
Term = Callable[[Names, Functions], Any]
"""Evaluates a part of a formula."""
COMPARISONS: Mapping[str, Callable[[Any, Any], object]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
SUMS: Mapping[str, Callable[[Any, Any], Any]] = {"+": operator.add, "-": operator.sub}
PRODUCTS: Mapping[str, Callable[[Any, Any], Any]] = {"*": operator.mul, "/": operator.truediv}
PYTHON_WORDS = {"True": "write `true`", "False": "write `false`", "None": "leave it out"}


class TermReader(Connectives[Term]):
    """Reads one formula into what evaluates it.

    Args:
        cursor: where the formula is read.
        functions: the names of the functions that it may call.
        resources: those that it may ask for, with their states.
    """

    def __init__(self, cursor: Cursor, functions: Collection[str], resources: Mapping[str, Sequence[str]]) -> None:
        super().__init__(cursor)
        self.names: dict[str, Span] = {}
        """What the formula needs, with the place where it is named first."""
        self._functions = functions
        self._resources = resources

    def formula(self) -> Term:
        """Read all of it."""
        read = self._choice(0)
        if not self.cursor.at_end:
            hint = "`%` is a unit; for the rest of a division write `mod(a, b)`" if "%" in {self._here, self.cursor.previous.text} else ""
            if self._here in COMPARISONS:
                hint = "compare two at a time: `0 < t and t < 9`"
            if self._here == ",":
                hint = "a list is written `[a, b]`"
            raise self.cursor.fail("an operator", hint=hint)
        return read

    @property
    def _here(self) -> str:
        return self.cursor.here.text

    def _choice(self, depth: int) -> Term:
        """Read `a if condition else b`."""
        first = self.implication(depth)
        if not self.cursor.accept("if"):
            return first
        condition = self.implication(depth)
        self.cursor.expect("else")
        second = self._choice(depth + 1)
        return lambda names, call: first(names, call) if _true(condition(names, call)) else second(names, call)

    # --- connectives -------------------------------------------------------------------------------------------------

    def implied(self, premise: Term, conclusion: Term) -> Term:
        """Return `premise => conclusion`."""
        return lambda names, call: not _true(premise(names, call)) or _true(conclusion(names, call))

    def either(self, operands: Sequence[Term]) -> Term:
        """Return the disjunction; what stands behind an operand that is true is not evaluated."""
        return lambda names, call: any(_true(one(names, call)) for one in operands)

    def both(self, operands: Sequence[Term]) -> Term:
        """Return the conjunction; what stands behind an operand that is false is not evaluated."""
        return lambda names, call: all(_true(one(names, call)) for one in operands)

    def negated(self, word: Token, operand: Term) -> Term:
        """Return the negation."""
        del word
        return lambda names, call: not _true(operand(names, call))

    def constant(self, word: Token) -> Term:
        """Return what the word `true` or `false` stands for."""
        value = word.text == "true"
        return lambda _names, _call: value

    def operand(self, depth: int) -> Term:
        """Read a comparison: parentheses belong to the terms."""
        return self.atom(depth)

    def atom(self, depth: int) -> Term:
        """Read a term, or a comparison of two; a resource is compared with a state."""
        left = self.cursor.here
        if left.text in self._resources and self.cursor.ahead().text in {"==", "!="}:
            return self._in_state(self._name())
        first = self._sum(depth)
        if self._here not in COMPARISONS or self.cursor.here.kind is not Kind.PUNCTUATION:
            return first
        compare, second = COMPARISONS[self.cursor.advance().text], self._sum(depth)
        return lambda names, call: compare(first(names, call), second(names, call))

    def _in_state(self, resource: str) -> Term:
        compare = COMPARISONS[self.cursor.advance().text]
        there = self.cursor.here
        states = self._resources[resource]
        if there.kind is Kind.STRING and string_value(there) in states:
            raise self.cursor.fail("a state", hint=f"write `{resource} {self.cursor.previous.text} {string_value(there)}`")
        state = self.cursor.name("a state").text
        if state not in states:
            message = f"resource {resource} has no state {state}; it has {choices(state, states)}"
            raise self._refuse(there, message)
        return lambda names, _call: compare(names[resource], state)

    # --- terms -------------------------------------------------------------------------------------------------------

    def _sum(self, depth: int) -> Term:
        parts = [(operator.add, self._product(depth))]
        while True:
            if self.cursor.here.kind is Kind.NUMBER and self._here.startswith("-"):
                parts.append((operator.add, self._product(depth)))  # `a -1`: the sign is the number's
            elif token := self.cursor.accept(*SUMS):
                parts.append((SUMS[token.text], self._product(depth)))
            else:
                return _folded(parts)

    def _product(self, depth: int) -> Term:
        parts = [(operator.mul, self._signed(depth))]
        while token := self.cursor.accept(*PRODUCTS):
            parts.append((PRODUCTS[token.text], self._signed(depth)))
        return _folded(parts)

    def _signed(self, depth: int) -> Term:
        negative = False
        while token := self.cursor.accept(*SUMS):
            negative ^= token.text == "-"
        term = self._accessed(depth)
        return (lambda names, call: -term(names, call)) if negative else term

    def _accessed(self, depth: int) -> Term:
        """Read a term with the fields and elements that are asked of it."""
        term = self._primary(depth)
        while token := self.cursor.accept(".", "["):
            if token.text == ".":
                field = self.cursor.name("a field")
                if field.text.startswith("_"):
                    raise self._refuse(field, f"the field {field.text} is not allowed in formulas")
                term = _field(term, field.text)
            else:
                term = _element(term, self._choice(depth + 1))
                self.cursor.expect("]")
        return term

    def _primary(self, depth: int) -> Term:
        self.limit(depth)
        cursor = self.cursor
        if token := cursor.accept("true", "false"):
            return self.constant(token)
        if cursor.accept("("):
            term = self._choice(depth + 1)
            cursor.expect(")", hint="a list is written `[a, b]`" if self._here == "," else "")
            return term
        if cursor.accept("["):
            return _list(self._several(depth, "]"))
        if cursor.here.kind is Kind.NUMBER:
            return _constant(self._number(cursor.advance()))
        if cursor.here.kind is Kind.STRING:
            return _constant(string_value(cursor.advance()))
        if cursor.here.kind is Kind.NAME and cursor.ahead().text == "(":
            return self._call(depth)
        name = self._name()
        return lambda names, _call: names[name]

    def _number(self, token: Token) -> float:
        cursor = self.cursor
        value = int(token.text) if token.text.lstrip("-").isdecimal() else number(cursor.source, token)
        if self._here not in UNIT_IN_SI or cursor.here.kind is Kind.END:
            return value
        unit = cursor.advance().text
        if self._here == "/" and f"{unit}/{cursor.ahead().text}" in UNIT_IN_SI:
            cursor.advance()
            unit = f"{unit}/{cursor.advance().text}"
        return value * UNIT_IN_SI[unit]

    def _call(self, depth: int) -> Term:
        function = self.cursor.advance()
        if function.text not in self._functions:
            raise self._refuse(function, f"there is no function {function.text}; there are {choices(function.text, self._functions)}")
        self.cursor.advance()
        arguments, name = self._several(depth, ")"), function.text
        return lambda names, call: call[name](*(one(names, call) for one in arguments))

    def _several(self, depth: int, end: str) -> list[Term]:
        """Read terms up to the bracket that closes them."""
        found: list[Term] = []
        while not self.cursor.accept(end):
            if found:
                self.cursor.expect(",", end)
                if self.cursor.previous.text == end:
                    break
            found.append(self._choice(depth + 1))
        return found

    def _name(self) -> str:
        here = self.cursor.here
        known = here.kind is Kind.NAME and here.text not in OPERATOR_WORDS
        if not known or here.text in {"if", "else"}:
            raise self.cursor.fail("a value")
        if here.text in PYTHON_WORDS:
            raise self.cursor.fail("a value", hint=PYTHON_WORDS[here.text])
        self.cursor.advance()
        self.names.setdefault(here.text, self.cursor.span(here))
        return here.text

    def _refuse(self, token: Token, message: str) -> SyntaxFault:
        self.cursor.source.report("ALU103", message, self.cursor.span(token))
        return SyntaxFault()


def read_terms(source: Source, functions: Collection[str], resources: Mapping[str, Sequence[str]]) -> tuple[Term | None, frozenset[str]]:
    """Read a formula; return what evaluates it and the names that it needs. What is wrong stands in the source's diagnostics."""
    reader = TermReader(Cursor(source), functions, resources)
    try:
        return reader.formula(), frozenset(reader.names)
    except SyntaxFault:
        return None, frozenset(reader.names)


def _true(value: object) -> bool:
    """Return a truth value as it is."""
    if isinstance(value, bool):
        return value
    raise TypeError(f"{value!r} is neither true nor false")


def _constant(value: object) -> Term:
    return lambda _names, _call: value


def _field(term: Term, name: str) -> Term:
    return lambda names, call: getattr(term(names, call), name)


def _element(term: Term, index: Term) -> Term:
    return lambda names, call: term(names, call)[index(names, call)]


def _list(parts: Sequence[Term]) -> Term:
    return lambda names, call: [one(names, call) for one in parts]


def _folded(parts: Sequence[tuple[Callable[[Any, Any], Any], Term]]) -> Term:
    """Return the terms joined from left to right, each by the operator before it."""
    (_, first), *others = parts
    if not others:
        return first

    def value(names: Names, call: Functions) -> Any:
        result = first(names, call)
        for join, term in others:
            result = join(result, term(names, call))
        return result

    return value
