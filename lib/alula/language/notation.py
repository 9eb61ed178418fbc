"""Which notation a text is in, and reading it in that one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import Enum
from itertools import pairwise
from pathlib import PurePath

from alula.language.lexer import MAX_CHARACTERS, Kind, Source, Token, tokenize
from alula.language.paper import PAPER
from alula.language.rl import ROBOT_LANGUAGE
from alula.language.syntax.document import Dialect, Document, read_document


class Notation(Enum):
    """The two ways to write a model; the value is what `--to` calls it."""

    PAPER = "paper"
    ROBOT_LANGUAGE = "rl"


SUFFIXES: Mapping[str, Notation] = {".skill": Notation.PAPER, ".rl": Notation.ROBOT_LANGUAGE}
_DIALECTS: Mapping[Notation, Dialect] = {Notation.PAPER: PAPER, Notation.ROBOT_LANGUAGE: ROBOT_LANGUAGE}

_CALLED: Mapping[Notation, str] = {Notation.PAPER: "the paper's notation", Notation.ROBOT_LANGUAGE: "the Robot Language"}
_PAPER_ROWS = frozenset(
    {("progress", "="), ("resource", "="), ("data", "="), ("violation", "="), ("apply", "="), ("period", "="), ("result", "{")}
)
_RL_WORDS = frozenset({"guard", "start", "postcondition", "failure"})


def notation_of(file: str, text: str) -> Notation:
    """Return the notation of a file by its suffix, or by its words where the suffix is none of the notations'."""
    suffix = PurePath(file).suffix.lower()
    return SUFFIXES[suffix] if suffix in SUFFIXES else sniff(tokenize(Source("", text)))


def sniff(tokens: list[Token]) -> Notation:
    """Return the notation that has more of its keywords among the tokens; the paper's where they are equal."""
    paper = rl = 0
    for token, following in pairwise(tokens):
        if token.kind is not Kind.NAME:
            continue
        paper += (token.text, following.text) in _PAPER_ROWS
        rl += token.text in _RL_WORDS or (token.text == "transition" and following.text == "{")
    return Notation.ROBOT_LANGUAGE if rl > paper else Notation.PAPER


def read(text: str, file: str = "", notation: Notation | None = None) -> tuple[Document, Source]:
    """Return what could be read of a text, and the source with what is wrong with it (the notation only, not the meaning)."""
    told = notation or SUFFIXES.get(PurePath(file).suffix.lower())
    if told is not None:
        document, source = _read_in(text, file, told)
        return document, _hinted(source, told)
    likely = notation_of(file, text)
    other = next(one for one in Notation if one is not likely)
    # A few words may not tell; then the notation in which it reads well does.
    return min((_read_in(text, file, one) for one in (likely, other)), key=lambda found: len(found[1].diagnostics))


def _hinted(source: Source, told: Notation) -> Source:
    """Say in the first finding of a text that it reads well in the other notation, if it does."""
    if source.diagnostics and len(source.text) <= MAX_CHARACTERS:
        other = next(one for one in Notation if one is not told)
        if not _read_in(source.text, source.file, other)[1].diagnostics:
            suffix = next(suffix for suffix, notation in SUFFIXES.items() if notation is other)
            hint = f"the text reads well in {_CALLED[other]}: name the file *{suffix}"
            source.diagnostics[0] = replace(source.diagnostics[0], hint=hint)
    return source


def _read_in(text: str, file: str, notation: Notation) -> tuple[Document, Source]:
    source = Source(file, text)
    return read_document(source, _DIALECTS[notation]), source
