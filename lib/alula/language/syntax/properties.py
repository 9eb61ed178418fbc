"""What the user wants proved, written the same way in both notations.

`name: never C`, `name: always C`, `name: eventually C`, `name: C leads to D`, each with `assuming termination` behind it where
the runs in which an execution never ends are to be left out.
"""

from __future__ import annotations

from alula.language.lexer import Kind
from alula.language.syntax.conditions import bare_condition
from alula.language.syntax.cursor import Cursor
from alula.model.model import Property, PropertyKind

_KINDS = (PropertyKind.NEVER, PropertyKind.ALWAYS, PropertyKind.EVENTUALLY)


def read_property(cursor: Cursor) -> Property:
    """Read `name: never | always | eventually CONDITION` or `name: CONDITION leads to CONDITION`, each with `assuming termination`."""
    name = cursor.name("the name of a property")
    cursor.expect(":", hint="a property is written `name: never ...`, `always ...`, `eventually ...` or `... leads to ...`")
    kind, consequence = _kind(cursor), None
    condition = bare_condition(cursor)
    if kind is PropertyKind.LEADS_TO:
        cursor.expect("leads", hint="begin with `never`, `always` or `eventually`, or go on with `leads to`")
        cursor.expect("to")
        consequence = bare_condition(cursor)
    fair = cursor.accept("assuming") is not None
    if fair:
        cursor.expect("termination")
    return Property(name.text, kind, condition, consequence, fair, span=cursor.span(name))


def _kind(cursor: Cursor) -> PropertyKind:
    """Read the word that the property begins with; without one it is `... leads to ...`."""
    following, after = cursor.ahead(), cursor.ahead(2)
    for kind in _KINDS:
        if cursor.at(kind.value) and (following.text == "(" or following.kind is Kind.NAME):
            # `never running` asks whether a skill named `never` runs, unless `running` is a resource that is compared.
            if following.text == "running" and after.text not in {"==", "!=", "running"}:
                break
            if following.text != "leads" or after.text != "to":
                cursor.advance()
                return kind
    return PropertyKind.LEADS_TO
