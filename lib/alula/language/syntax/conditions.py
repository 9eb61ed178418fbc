"""Conditions of both notations.

The paper's: `resource = (a == S and not b != T)`, `data = (battery.level > 0.2)`, and both joined by and, or, not, =>.
The Robot Language's and every property: the same without the words `resource = (...)` and `data = (...)` around it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from alula.language.lexer import Kind, Token, string_value
from alula.language.syntax.connectives import Connectives
from alula.language.syntax.cursor import OPERATOR_WORDS, Cursor
from alula.language.syntax.quantities import quantity
from alula.model.expressions import And, Comparison, Constant, DataIs, Expression, Implies, MissionIs, Not, Or, ResourceIs, SkillRuns

Atom = Callable[[int], Expression]
_COMPARISONS = tuple(comparison.value for comparison in Comparison)
_EQUALITIES = ("==", "!=")
_MISSION_HINT = "ask `skillset.resource == STATE`, `skillset.skill running`, `active('node')`, `outcome given_up` or `fault name`"
_NO_EXECUTION = frozenset({*_COMPARISONS, ".", ":", "{", "->"})
"""What tells that `running` is a name of its own and does not belong to the name before it."""


def paper_condition(cursor: Cursor) -> Expression:
    """Read a condition of the paper's notation, as it stands behind `name:` in a precondition or invariant."""
    return _Reader(cursor, bare=False).implication()


def bare_condition(cursor: Cursor) -> Expression:
    """Read a condition of the Robot Language, or of a property in either notation."""
    return _Reader(cursor, bare=True).implication()


def mission_condition(cursor: Cursor) -> Expression:
    """Read a condition of a mission's property: resources and skills with their skillset, nodes, the outcome, faults."""
    return _MissionReader(cursor, bare=True).implication()


class _Reader(Connectives[Expression]):
    """Reads one condition; ``_atom`` changes with where we are: outside, in `resource = (...)` or in `data = (...)`."""

    def __init__(self, cursor: Cursor, *, bare: bool) -> None:
        super().__init__(cursor)
        self._atom: Atom = self._bare_atom if bare else self._predicate

    def implied(self, premise: Expression, conclusion: Expression) -> Expression:
        return Implies(premise, conclusion, span=premise.span)

    def either(self, operands: Sequence[Expression]) -> Expression:
        return Or(tuple(operands), span=operands[0].span)

    def both(self, operands: Sequence[Expression]) -> Expression:
        return And(tuple(operands), span=operands[0].span)

    def negated(self, word: Token, operand: Expression) -> Expression:
        return Not(operand, span=self.cursor.span(word))

    def constant(self, word: Token) -> Expression:
        return Constant(word.text == "true", span=self.cursor.span(word))

    def atom(self, depth: int) -> Expression:
        return self._atom(depth)

    # --- the paper's predicates -----------------------------------------------------------------------------------

    def _predicate(self, depth: int) -> Expression:
        """Read `resource = (...)` or `data = (...)`."""
        if not self.cursor.at("resource", "data"):
            raise self.cursor.fail("`resource`", "`data`", "`not`", "`(`", hint=self._predicate_hint())
        word = self.cursor.advance()
        self.cursor.expect("=", hint=f"a condition is written `{word.text} = (...)`")
        outside, self._atom = self._atom, (self._resource_atom if word.text == "resource" else self._data_atom)
        try:
            return self.parenthesised(depth + 1)
        finally:
            self._atom = outside

    def _predicate_hint(self) -> str:
        if self.cursor.ahead().text in _EQUALITIES:
            return "put it into `resource = (...)`, or `data = (...)` if it is about data"
        return ""

    def _resource_atom(self, _depth: int) -> Expression:
        first = self.cursor.name("a resource")
        self._refuse_assignment()
        operator = self.cursor.expect(*_EQUALITIES)
        return self._is_state(first, operator)

    def _data_atom(self, _depth: int) -> Expression:
        first = self.cursor.name("data")
        return self._is_value(first, self._path())

    # --- atoms without the words ----------------------------------------------------------------------------------

    def _bare_atom(self, depth: int) -> Expression:
        cursor = self.cursor
        if cursor.at("resource", "data") and cursor.ahead().text == "=" and cursor.ahead(2).text == "(":
            return self._predicate(depth)
        first = cursor.name("a condition")
        if cursor.at("running") and cursor.ahead().text not in _NO_EXECUTION:
            return SkillRuns(first.text, span=cursor.span(first, cursor.advance()))
        path = self._path()
        if not path and cursor.at(*_EQUALITIES) and cursor.ahead().kind is Kind.NAME and cursor.ahead().text not in OPERATOR_WORDS:
            return self._is_state(first, cursor.advance())
        if not path:
            self._refuse_assignment()
        return self._is_value(first, path)

    def _refuse_assignment(self) -> None:
        if self.cursor.at("=") and self.cursor.ahead().kind is Kind.NAME:
            raise self.cursor.fail("`==`", "`!=`", hint="states are compared with `==`")

    def _is_state(self, first: Token, operator: Token) -> Expression:
        state = self.cursor.name("a state")
        return ResourceIs(first.text, state.text, operator.text == "!=", span=self.cursor.span(first, state))

    def _path(self) -> tuple[str, ...]:
        path: list[str] = []
        while self.cursor.accept("."):
            path.append(self.cursor.name("a field").text)
        return tuple(path)

    def _is_value(self, first: Token, path: tuple[str, ...]) -> Expression:
        last = self.cursor.previous
        if not self.cursor.at(*_COMPARISONS):
            # A truth value may stand alone.
            return DataIs(first.text, path, Comparison.EQ, value=True, span=self.cursor.span(first, last))
        comparison = Comparison(self.cursor.advance().text)
        value, unit = self._value()
        return DataIs(first.text, path, comparison, value, unit, span=self.cursor.span(first, self.cursor.previous))

    def _value(self) -> tuple[float | str | bool, str]:
        cursor = self.cursor
        if token := cursor.accept("true", "false"):
            return token.text == "true", ""
        if cursor.here.kind is Kind.STRING:
            return string_value(cursor.advance()), ""
        if cursor.here.kind is not Kind.NUMBER:
            other = cursor.here.kind is Kind.NAME and cursor.previous.text in _EQUALITIES
            hint = "states are compared with a resource's name alone; those of another skillset can't be asked" if other else ""
            raise cursor.fail("a number", 'a string in `"`', "`true`", "`false`", hint=hint)
        return quantity(cursor, enclosed=self.enclosed > 0)


class _MissionReader(_Reader):
    """Reads a condition of a mission: names of a skillset's members have its name before them, and there is no data."""

    def _bare_atom(self, _depth: int) -> Expression:
        cursor = self.cursor
        first = cursor.here
        if cursor.at("active") and cursor.ahead().text == "(":
            cursor.advance()
            cursor.advance()
            node = self._node()
            cursor.expect(")")
            return MissionIs("active", node, span=cursor.span(first, cursor.previous))
        if cursor.at("outcome", "fault") and cursor.ahead().kind is Kind.NAME:
            word, name = cursor.advance(), cursor.advance()
            return MissionIs(word.text, name.text, span=cursor.span(word, name))
        if cursor.at("running") and cursor.ahead().text == "(":
            raise cursor.fail("a condition", hint=f"write `{self._asked_of_script()} running`")
        if first.kind is not Kind.NAME or first.text in OPERATOR_WORDS:
            raise cursor.fail("a condition", hint=_MISSION_HINT)
        skillset = cursor.name("a skillset")
        cursor.expect(".", hint=_MISSION_HINT)
        member = f"{skillset.text}.{cursor.name('a name of the skillset').text}"
        if token := cursor.accept("running"):
            return SkillRuns(member, span=cursor.span(first, token))
        operator = cursor.expect("==", "!=", "running", hint=_MISSION_HINT)
        state = cursor.name("a state")
        return ResourceIs(member, state.text, operator.text == "!=", span=cursor.span(first, state))

    def _asked_of_script(self) -> str:
        """Return the skill that stands in `running(...)`, as scripts of nodes have it."""
        parts = [self.cursor.ahead(offset).text for offset in range(2, 5)]
        return "".join(parts) if parts[1] == "." else "skillset.skill"

    def _node(self) -> str:
        if self.cursor.here.kind is not Kind.STRING:
            raise self.cursor.fail("the name of a node in quotes")
        return string_value(self.cursor.advance())
