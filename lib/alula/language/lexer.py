"""From text to tokens, for both notations: names, numbers, strings, punctuation; `//` comments stay with their token.

`/* ... */` is a comment, too; it stays with no token.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from enum import Enum

from alula.language.errors import Diagnostic
from alula.model.span import Span

MAX_CHARACTERS = 300_000
"""Models are a few kilobytes; whatever is larger than this is no model, and is refused before it costs time."""

MAX_ERRORS = 40
MAX_NAME = 200


class Kind(Enum):
    """What a token is; its value is how a message calls it."""

    NAME = "a name"
    NUMBER = "a number"
    STRING = "a string"
    PUNCTUATION = "punctuation"
    END = "the end"


@dataclass(slots=True)
class Token:
    """A word of the source. ``comment`` is the text of a `//` comment that follows it on its line."""

    kind: Kind
    text: str
    line: int
    column: int
    comment: str = ""

    def shown(self, source: Source) -> str:
        """Return the token as a message names it."""
        return source.ends if self.kind is Kind.END else f"`{self.text[:40]}`"


@dataclass
class Source:
    """A text, the name it goes by, and the findings about it so far."""

    file: str
    text: str
    diagnostics: list[Diagnostic] = field(default_factory=list)

    transitions: int = 0
    """How many transitions of resources were read."""
    ends: str = "the end of the file"
    """How messages call what stands behind the last character."""

    def __post_init__(self) -> None:
        self._lines: list[str] | None = None

    def line(self, number: int) -> str:
        """Return a line of the text, 1-based; empty when there is none."""
        if self._lines is None:
            self._lines = self.text.split("\n")
        return self._lines[number - 1] if 0 < number <= len(self._lines) else ""

    @property
    def full(self) -> bool:
        """Whether no more findings are wanted: there are more than ``MAX_ERRORS``."""
        return len(self.diagnostics) > MAX_ERRORS

    def span(self, token: Token) -> Span:
        """Return the place of a token."""
        return Span(self.file, token.line, token.column, token.column + max(1, len(token.text)))

    def report(self, code: str, message: str, span: Span, *, hint: str = "", expected: tuple[str, ...] = ()) -> None:
        """Add an error, once for a place; ignore all that come after too many."""
        if self.full or any(known.code == code and known.span == span for known in self.diagnostics):
            return
        if len(self.diagnostics) == MAX_ERRORS:
            code, message, hint, expected = "ALU107", f"more than {MAX_ERRORS} errors: not read further", "", ()
        self.diagnostics.append(Diagnostic(code, message, span, hint=hint, expected=expected, source_line=self.line(span.line)))


_TOKEN = re.compile(
    r"""(?P<space>[ \t\r\f\v]+)
      | (?P<newline>\n)
      | (?P<comment>//[^\n]*)
      | (?P<block>/\*(?s:.*?)\*/)
      | (?P<endless>/\*)
      | (?P<NAME>[A-Za-z_][A-Za-z0-9_]*)
      | (?P<NUMBER>-?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
      | (?P<STRING>"(?:[^"\\\n]|\\[^\n])*"|'(?:[^'\\\n]|\\[^\n])*')
      | (?P<open>["'][^\n]*)
      | (?P<PUNCTUATION>->|=>|==|!=|<=|>=|[{}():=<>.,;%/*+\[\]-])
      | (?P<bad>[^\sA-Za-z0-9_"'{}():=<>.,;%/*+\[\]-]+|.)""",
    re.VERBOSE,
)


def tokenize(source: Source) -> list[Token]:
    """Return the tokens of a text, an END token last; report into ``source`` what is no token and go on after it."""
    text = source.text
    if len(text) > MAX_CHARACTERS:
        message = f"{len(text)} characters are too much for a model; at most {MAX_CHARACTERS} are read"
        source.report("ALU003", message, Span(source.file, 0, 0, 0))
        return [Token(Kind.END, "", 1, 1)]
    tokens: list[Token] = []
    line, line_start = 1, 0
    for match in _TOKEN.finditer(text):
        group = match.lastgroup
        if group == "space":
            continue
        if group == "newline":
            line, line_start = line + 1, match.end()
            continue
        column = match.start() - line_start + 1
        if group == "endless":
            source.report("ALU108", "this comment has no `*/`", Span(source.file, line, column, column + 2))
            break
        if group == "block":
            if ends := match.group().count("\n"):
                line, line_start = line + ends, match.start() + match.group().rindex("\n") + 1
            continue
        if group == "comment":
            if tokens and tokens[-1].line == line:
                tokens[-1].comment = " ".join(match.group()[2:].split())
        elif group in {"bad", "open"}:
            _report_bad(source, match.group(), Span(source.file, line, column, column + len(match.group())), unclosed=group == "open")
            if source.full:
                break
        else:
            tokens.append(_shortened(source, Token(Kind[str(group)], match.group(), line, column)))
    tokens.append(_end(text))
    return tokens


def _end(text: str) -> Token:
    """Return the token behind the last character, also where reading has stopped before."""
    return Token(Kind.END, "", text.count("\n") + 1, len(text) - text.rfind("\n"))


def _shortened(source: Source, token: Token) -> Token:
    """Return a token as it is, or a name that is too long cut, for messages that people can read."""
    if token.kind is not Kind.NAME or len(token.text) <= MAX_NAME:
        return token
    length, token.text = len(token.text), token.text[:MAX_NAME]
    source.report("ALU110", f"a name of {length} characters; there may be {MAX_NAME}", source.span(token))
    return token


def number(source: Source, token: Token) -> float:
    """Return the value of a NUMBER token; report one that a double can't hold and return 0."""
    value = float(token.text)
    if math.isfinite(value):
        return value
    source.report("ALU102", f"{token.shown(source)} is too large for a number", source.span(token))
    return 0.0


def string_value(token: Token) -> str:
    r"""Return what a STRING token stands for: ``\n`` is a line end, any other escaped character is itself."""
    return re.sub(r"\\(.)", lambda match: "\n" if match[1] == "n" else match[1], token.text[1:-1])


def _report_bad(source: Source, text: str, span: Span, *, unclosed: bool) -> None:
    if unclosed:
        source.report("ALU101", f"the string has no closing `{text[0]}` on its line", span)
        return
    shown = text[:20] if text.isprintable() else " ".join(f"U+{ord(c):04X}" for c in text[:5])
    hint = "names are made of a-z, A-Z, 0-9 and _" if text[0].isalpha() else ""
    source.report("ALU100", f"`{shown}` means nothing here", span, hint=hint)
