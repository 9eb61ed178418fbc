"""What the user wants proved, written the same way in both notations.

`name: never C`, `name: always C`, `name: eventually C`, `name: C leads to D`, each with `assuming termination` behind it where
the runs in which an execution never ends are to be left out.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from alula.language.errors import Diagnostic
from alula.language.lexer import Kind, Source
from alula.language.syntax.conditions import bare_condition, mission_condition
from alula.language.syntax.cursor import Cursor, SyntaxFault
from alula.model.expressions import Expression
from alula.model.model import Property, PropertyKind

MOST_TICKS = 1000
_KINDS = (PropertyKind.NEVER, PropertyKind.ALWAYS, PropertyKind.EVENTUALLY)


def read_property(cursor: Cursor) -> Property:
    """Read `name: never | always | eventually CONDITION` or `name: CONDITION leads to CONDITION`, each with `assuming termination`."""
    return _read(cursor, bare_condition)


def property_of_mission(text: str, ends: str) -> Property | Diagnostic:
    """Read a property of a mission, all of a text: as those of models, and behind `leads to CONDITION` perhaps `within N ticks`.

    Return the first thing that is wrong where it can't be read; ``ends`` is how messages call the text's end.
    """
    source = Source("", text.replace("\n", " "), ends=ends)
    with suppress(SyntaxFault):
        cursor = Cursor(source)
        one = _read(cursor, mission_condition, ticks=True)
        if not cursor.at_end:
            cursor.fail("the end", hint="write `=>` for `->`" if cursor.at("->") else "")
        if not source.diagnostics:
            return one
    return source.diagnostics[0]


def _read(cursor: Cursor, read_condition: Callable[[Cursor], Expression], *, ticks: bool = False) -> Property:
    name = cursor.name("the name of a property")
    cursor.expect(":", hint="a property is written `name: never ...`, `always ...`, `eventually ...` or `... leads to ...`")
    kind, consequence = _kind(cursor), None
    condition = read_condition(cursor)
    if kind is PropertyKind.LEADS_TO:
        cursor.expect("leads", hint="begin with `never`, `always` or `eventually`, or go on with `leads to`")
        cursor.expect("to")
        consequence = read_condition(cursor)
    within = _ticks(cursor) if ticks and consequence is not None and cursor.accept("within") else 0
    fair = cursor.accept("assuming") is not None
    if fair:
        cursor.expect("termination")
    return Property(name.text, kind, condition, consequence, fair, within, span=cursor.span(name))


def _ticks(cursor: Cursor) -> int:
    token = cursor.kind(Kind.NUMBER)
    if not token.text.isdecimal() or not 0 < int(token.text) <= MOST_TICKS:
        cursor.source.report("ALU103", f"expected a number of ticks from 1 to {MOST_TICKS}", cursor.span(token))
        raise SyntaxFault
    cursor.expect("ticks")
    return int(token.text)


def _kind(cursor: Cursor) -> PropertyKind:
    """Read the word that the property begins with; without one it is `... leads to ...`."""
    following, after = cursor.ahead(), cursor.ahead(2)
    for kind in _KINDS:
        if cursor.at(kind.value) and (following.text == "(" or following.kind is Kind.NAME):
            # `never running` asks whether a skill named `never` runs, unless `running` is a resource that is compared.
            if following.text == "running" and after.text not in {"==", "!=", "running", "("}:
                break
            if following.text != "leads" or after.text != "to":
                cursor.advance()
                return kind
    return PropertyKind.LEADS_TO
