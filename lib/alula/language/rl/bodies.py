"""Bodies of the Robot Language: `guard`, `effect`, `postcondition` and the like, in any order, in braces or without."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from alula.language.lexer import Kind, Token
from alula.language.syntax.conditions import bare_condition
from alula.language.syntax.cursor import Cursor, starts_member
from alula.language.syntax.elements import read_changes
from alula.language.syntax.quantities import duration, hold
from alula.model.expressions import TRUE, Expression
from alula.model.model import NO_EFFECT, Assignment, Effect, Hold

OUTSIDE = ("resource", "event", "skill", "property")
"""What can't begin inside of a skill."""


def outside(cursor: Cursor) -> bool:
    """Return whether something begins that can only stand outside of the skill."""
    return starts_member(cursor, OUTSIDE)


@dataclass
class Body:
    """What was read of an invariant's, a result's or the interruption's body."""

    condition: Expression | None = None
    hold: Hold | None = None
    changes: list[Assignment] = field(default_factory=list)
    reference: Effect | None = None
    postcondition: Expression = TRUE
    interrupting: bool = False
    timeout_s: float | None = None
    seen: set[str] = field(default_factory=set)

    def effect(self, cursor: Cursor, at: Token) -> Effect:
        """Return the effect: the changes in place, or the one that is referred to by its name until ``SkillParts.build``."""
        if self.reference is not None:
            return self.reference
        return Effect("", tuple(self.changes), span=cursor.span(at)) if self.changes else NO_EFFECT


def read_body(cursor: Cursor, words: tuple[str, ...]) -> Body:
    """Read `{ word ... word ... }`, or the same without braces, of those of the words that are allowed."""
    body = Body()

    def member() -> None:
        if not cursor.at(*words):
            hint = "close the block before with `}`" if cursor.ahead().text == "{" else ""
            raise cursor.fail(*(f"`{word}`" for word in words), "`}`", hint=hint)
        word = cursor.here
        if word.text in body.seen and word.text != "effect":
            cursor.source.report("ALU106", f"`{word.text}` is given twice in this block", cursor.span(word))
        body.seen.add(cursor.advance().text)
        _MEMBERS[word.text](cursor, body)

    if cursor.at("{"):
        cursor.block(member, lambda: outside(cursor), lambda: cursor.at(*words))
        return body
    while cursor.at(*words) and not _is_another(cursor):
        member()
    return body


def _is_another(cursor: Cursor) -> bool:
    """Tell an `effect` block of the skill, or an entry named like a word, from what belongs to a body without braces."""
    following, after = cursor.ahead(), cursor.ahead(2)
    if following.text == ":" or (following.text == "{" and not cursor.at("effect")):
        return True
    if not cursor.at("effect"):
        return False
    if following.text == "{":
        return after.kind is Kind.NAME and cursor.ahead(3).text in {":", "{"}
    return following.kind is Kind.NAME and after.text in {":", "{"}


def _guard(cursor: Cursor, body: Body) -> None:
    cursor.accept(":", "=")
    body.condition = bare_condition(cursor)
    body.hold = hold(cursor)


def _effect(cursor: Cursor, body: Body) -> None:
    cursor.accept(":", "=")
    reference = read_effect(cursor, body.changes)
    if reference is not None:
        body.reference = reference


def _postcondition(cursor: Cursor, body: Body) -> None:
    cursor.accept(":", "=")
    body.postcondition = bare_condition(cursor)


def _interrupting(cursor: Cursor, body: Body) -> None:
    cursor.accept(":", "=")
    given = cursor.accept("true", "false")
    body.interrupting = given is None or given.text == "true"


def _timeout(cursor: Cursor, body: Body) -> None:
    cursor.accept(":", "=")
    body.timeout_s = duration(cursor)


_MEMBERS: Mapping[str, Callable[[Cursor, Body], None]] = {
    "guard": _guard,
    "effect": _effect,
    "postcondition": _postcondition,
    "interrupting": _interrupting,
    "timeout": _timeout,
}


def read_effect(cursor: Cursor, changes: list[Assignment]) -> Effect | None:
    """Read changes into ``changes``, or the name of one of the skill's effects and return it."""
    if cursor.here.kind is Kind.NAME and cursor.ahead().text != "->":
        name = cursor.name("a resource")
        if cursor.at("=") or (cursor.at("=>") and cursor.ahead().kind is Kind.NAME):
            raise cursor.fail("`->`", hint="a change is written `resource -> STATE`")
        return Effect(name.text, span=cursor.span(name))
    read_changes(cursor, changes, lambda: outside(cursor))
    return None
