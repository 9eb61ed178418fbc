"""Numbers with units, durations, and how long an invariant's condition may be false."""

from __future__ import annotations

from collections.abc import Mapping

from alula.language.lexer import Kind, number
from alula.language.syntax.cursor import OPERATOR_WORDS, Cursor
from alula.model.model import Hold
from alula.model.units import UNIT_IN_SI

SECONDS: Mapping[str, float] = {"ms": 0.001, "s": 1.0, "sec": 1.0, "min": 60.0, "h": 3600.0}
"""What a duration may be written in."""


def quantity(cursor: Cursor, *, enclosed: bool) -> tuple[float, str]:
    """Read a number and its unit, if it has one.

    Within parentheses (``enclosed``) every name that follows is taken for a unit, so that an unknown one can be reported. Without,
    the next entry's name or the next word of the language may follow: only a known unit on the number's own line is one.
    """
    value = number(cursor.source, cursor.kind(Kind.NUMBER))
    if cursor.at("%"):
        return value, cursor.advance().text
    if cursor.here.kind is not Kind.NAME or cursor.here.text in OPERATOR_WORDS:
        return value, ""
    known = cursor.here.text in UNIT_IN_SI and cursor.same_line() and cursor.ahead().text not in {":", "{", "->"}
    if not enclosed and not known:
        return value, ""
    unit = cursor.advance().text
    return value, f"{unit}/{cursor.name('a unit').text}" if cursor.accept("/") else unit


def duration(cursor: Cursor) -> float:
    """Read `2 s`, `100 ms` or `2` and return seconds."""
    value = number(cursor.source, cursor.kind(Kind.NUMBER))
    if cursor.at(*SECONDS) and cursor.same_line() and cursor.ahead().text not in {":", "{", "->"}:
        return value * SECONDS[cursor.advance().text]
    return value


def setting(cursor: Cursor, word: str) -> float:
    """Read `word 2 s`, `word = 2` or `word: 2 s` and return seconds."""
    cursor.expect(word)
    cursor.accept("=", ":")
    return duration(cursor)


def hold(cursor: Cursor) -> Hold | None:
    """Read `for 2 s`, `recovers at 12`, both or none, as they stand behind an invariant's condition."""
    first = cursor.here
    for_s = 0.0
    if at_for := cursor.at("for") and cursor.ahead().kind is Kind.NUMBER:
        cursor.advance()
        for_s = duration(cursor)
    if not (cursor.at("recovers") and cursor.ahead().text == "at"):
        return Hold(for_s, span=cursor.span(first, cursor.previous)) if at_for else None
    cursor.advance()
    cursor.expect("at")
    enclosed = cursor.accept("(") is not None
    value, unit = quantity(cursor, enclosed=enclosed)
    span = cursor.span(first, cursor.previous)
    if enclosed:
        cursor.expect(")")
    return Hold(for_s, value, unit, span=span)
