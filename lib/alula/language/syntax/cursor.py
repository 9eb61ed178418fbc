"""A place in a row of tokens, what may come next, and how to go on after an error."""

from __future__ import annotations

from collections.abc import Callable, Collection

from alula.language.lexer import Kind, Source, Token, tokenize
from alula.model.span import Span


class SyntaxFault(Exception):  # noqa: N818 - it never leaves the parser
    """What stands here can't be read; it has been reported already. The block around it goes on at its end."""


OPERATOR_WORDS = frozenset({"and", "or", "not", "true", "false"})
"""The only words that can't be names anywhere; all others have their meaning by where they stand."""


class Cursor:
    """Walks over the tokens of one source; every ``expect`` reports and raises SyntaxFault when it isn't met."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self._tokens = tokenize(source)
        self._index = 0
        self._ended = False

    @property
    def here(self) -> Token:
        """The token that is read next."""
        return self._tokens[self._index]

    @property
    def previous(self) -> Token:
        """The token that was read last (the first one before anything was read)."""
        return self._tokens[max(0, self._index - 1)]

    @property
    def at_end(self) -> bool:
        """Nothing is left to read."""
        return self.here.kind is Kind.END

    def ahead(self, offset: int = 1) -> Token:
        """Return a later token without reading it."""
        return self._tokens[min(self._index + offset, len(self._tokens) - 1)]

    def advance(self) -> Token:
        """Read one token; the END token stays where it is."""
        token = self.here
        self._index = min(self._index + 1, len(self._tokens) - 1)
        return token

    def at(self, *texts: str) -> bool:
        """Return whether one of these punctuations or words comes next."""
        return self.here.text in texts and self.here.kind in {Kind.NAME, Kind.PUNCTUATION}

    def at_word(self, word: str) -> bool:
        """Return whether this word comes next in its meaning for the language, not as a name of an entry or state."""
        return self.at(word) and self.ahead().text not in {":", "->"}

    def accept(self, *texts: str) -> Token | None:
        """Read the next token if it is one of these."""
        return self.advance() if self.at(*texts) else None

    def expect(self, *texts: str, hint: str = "") -> Token:
        """Read one of these or fail."""
        if self.at(*texts):
            return self.advance()
        raise self.fail(*(f"`{text}`" for text in texts), hint=hint)

    def name(self, what: str) -> Token:
        """Read a name; ``what`` says whose, as in `a state`."""
        if self.here.kind is Kind.NAME and self.here.text not in OPERATOR_WORDS:
            return self.advance()
        hint = f"`{self.here.text}` is a word of the language, choose another name" if self.here.text in OPERATOR_WORDS else ""
        raise self.fail(what, hint=hint)

    def kind(self, kind: Kind) -> Token:
        """Read a token of this kind or fail."""
        if self.here.kind is kind:
            return self.advance()
        raise self.fail(kind.value)

    def same_line(self, offset: int = 0) -> bool:
        """Return whether the token that many places ahead stands on the line of the token read last."""
        return self.ahead(offset).line == self.previous.line

    def span(self, first: Token, last: Token | None = None) -> Span:
        """Return the place from one token to another of the same line (to the first one's end when it isn't)."""
        span = self.source.span(first)
        if last is None or last.line != first.line:
            return span
        return Span(span.file, span.line, span.column, self.source.span(last).end_column)

    def fail(self, *expected: str, hint: str = "") -> SyntaxFault:
        """Report that something else was expected here and return the fault to raise."""
        message = f"expected {' or '.join(expected) if len(expected) <= _FEW else 'something else'}, found {self.here.shown(self.source)}"
        listed = expected if len(expected) > 1 else ()
        self.source.report("ALU103", message, self.source.span(self.here), hint=hint, expected=listed)
        return SyntaxFault()

    def block(self, entry: Callable[[], None], outer: Callable[[], bool], begins: Callable[[], bool] | None = None) -> None:
        """Read `{ entry* }`, commas or semicolons allowed between entries.

        ``outer`` tells that what comes next can only stand outside, so that the `}` is missing. After an entry that can't be
        read it goes on where ``begins`` tells that another one begins, by default with `name:` or `name {` first in a line.
        """
        opening = self.expect("{")
        while not self._closed():
            if self.at_end or outer():
                self._missing_end(opening)
                return
            before = self._index
            try:
                entry()
                if self._index == before:
                    raise self.fail("another entry", "`}`")
            except SyntaxFault:
                if not self._skip_entry(outer, begins or self._begins_entry, minimum=before):
                    return
            if self.source.full:
                self._index = len(self._tokens) - 1
                return

    def _begins_entry(self) -> bool:
        first = self.here.line > self.previous.line
        return first and self.here.kind is Kind.NAME and self.ahead().text in {":", "{"}

    def _closed(self) -> bool:
        """Skip commas and semicolons between entries, and the `}` if it is there."""
        while self.accept(",", ";"):
            pass
        return self.accept("}") is not None

    def _missing_end(self, opening: Token) -> None:
        if self.at_end:
            # The innermost block tells; that those around it have no end either goes without saying.
            if self._ended:
                return
            self._ended = True
            self.source.report("ALU104", "this block has no `}` before the file ends", self.source.span(opening))
            return
        message = f"the block opened in line {opening.line} has no `}}` before {self.here.shown(self.source)} begins"
        self.source.report("ALU104", message, self.source.span(self.here), hint="close the block with `}`")

    def _skip_entry(self, outer: Callable[[], bool], begins: Callable[[], bool], *, minimum: int) -> bool:
        """Skip the rest of an entry; False where the block ends behind it, or something begins that can only stand outside."""
        depth = sum({"{": 1, "}": -1}.get(token.text, 0) for token in self._tokens[minimum : self._index])
        if self._index == minimum and self.here.text not in {"{", "}"} and not outer():
            self.advance()
        while not self.at_end:
            if depth <= 0 and outer():
                return False
            if depth <= 0 and self._index > minimum and begins():
                return True
            if self.here.text == "{":
                depth += 1
            elif self.here.text == "}":
                depth -= 1
                if depth < 0:
                    self.advance()
                    return False
            self.advance()
        return False


def starts_block(cursor: Cursor, words: Collection[str]) -> bool:
    """Return whether `word {` comes next, with one of these words."""
    return cursor.here.text in words and cursor.here.kind is Kind.NAME and cursor.ahead().text == "{"


def starts_member(cursor: Cursor, words: Collection[str]) -> bool:
    """Return whether `word name {` or `word name:` comes next, with one of these words, as in `skill takeoff {`."""
    if cursor.here.text not in words or cursor.here.kind is not Kind.NAME:
        return False
    return cursor.ahead().kind is Kind.NAME and cursor.ahead(2).text in {"{", ":"}


_FEW = 3
