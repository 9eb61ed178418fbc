"""Small elements that both notations write the same way: typed names, data, types, uses and changes of resources."""

from __future__ import annotations

from collections.abc import Callable

from alula.language.lexer import Kind
from alula.language.syntax.cursor import Cursor
from alula.language.syntax.quantities import quantity, setting
from alula.model.model import Assignment, Data, Parameter, Role
from alula.model.units import told_unit


def one_or_block(cursor: Cursor, entry: Callable[[], None], outer: Callable[[], bool]) -> None:
    """Read `word entry` or `word { entry* }`."""
    cursor.advance()
    if cursor.at("{"):
        cursor.block(entry, outer)
    else:
        entry()


def read_parameter(cursor: Cursor, what: str) -> Parameter:
    """Read `name: Type // comment`, with a default behind it where it is a parameter: `name: Type = 0.5 m/s`."""
    name = cursor.name(what)
    cursor.expect(":", hint=f"{what} is written `name: Type`")
    kind = cursor.name("a type")
    default = ""
    if what == "a parameter" and cursor.accept("="):
        default = _literal(cursor)
    return Parameter(name.text, kind.text, default, cursor.previous.comment, span=cursor.span(name, kind))


def _literal(cursor: Cursor) -> str:
    """Return the source text of a number with its unit, a string, a truth value or a name."""
    if cursor.here.kind is Kind.NUMBER:
        text = cursor.here.text
        _, unit = quantity(cursor, enclosed=False)
        return f"{text} {unit}" if unit else text
    if cursor.here.kind is Kind.STRING or cursor.at("true", "false"):
        return cursor.advance().text
    if cursor.here.kind is Kind.NAME:
        return cursor.name("a value").text
    raise cursor.fail("a number", 'a string in `"`', "`true`", "`false`", "a name")


def read_role(cursor: Cursor) -> Role:
    """Read the name of a role, as behind `provides` and `needs`."""
    name = cursor.name("the name of a role")
    return Role(name.text, span=cursor.span(name))


def read_data(cursor: Cursor) -> Data:
    """Read `name: Type`, `name: Type period 1 sec` or `name: Type period = 0.5`, and behind it `// unit`."""
    name = cursor.name("the name of data")
    cursor.expect(":", hint="data is written `name: Type period 0.5 s`")
    kind = cursor.name("a type")
    # `data { a: T  period: U }` has a second data of that name.
    another = cursor.ahead().text == ":" and cursor.ahead(2).kind is Kind.NAME
    period = setting(cursor, "period") if cursor.at("period") and not another else None
    return Data(name.text, kind.text, period, told_unit(cursor.previous.comment), span=cursor.span(name, kind))


def read_change(cursor: Cursor) -> Assignment:
    """Read `resource -> STATE`, one assignment of an effect."""
    resource = cursor.name("a resource")
    cursor.expect("->")
    state = cursor.name("a state")
    return Assignment(resource.text, state.text, span=cursor.span(resource, state))


def read_changes(cursor: Cursor, changes: list[Assignment], outer: Callable[[], bool]) -> None:
    """Read `{ a -> S  b -> T }`, or the same without braces, and append to ``changes``."""
    if cursor.at("{"):
        cursor.block(lambda: changes.append(read_change(cursor)), outer)
        return
    changes.append(read_change(cursor))
    while (cursor.at(",") and cursor.ahead(2).text == "->") or (cursor.here.kind is Kind.NAME and cursor.ahead().text == "->"):
        cursor.accept(",")
        changes.append(read_change(cursor))
