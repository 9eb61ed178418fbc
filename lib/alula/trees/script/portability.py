"""What BT.CPP 4.8 and 4.9 read differently: a script that holds none of it means the same in every BT.CPP 4.

4.9 replaced the parser (BT.CPP pull requests 1069 and 1099). Alula reads what either reads, with the later meaning.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from alula.trees.script.lexer import Kind, Token
from alula.trees.script.program import Note
from alula.trees.script.syntax import Call, Name, Node, walk

_GROUPS = {
    **dict.fromkeys(("+", "-", "*", "/"), "arithmetic"),
    **dict.fromkeys(("&", "|", "^", "~", "!"), "logic of bits"),
    "..": "joining texts",
}


class Groups:
    """The operators that one expression has used: 4.8 refuses two groups in one, unless one is in brackets."""

    def __init__(self) -> None:
        self._first = ""

    def meet(self, token: Token) -> Note | None:
        """Take up an operator; return a note at one of another group than the first."""
        group = _GROUPS.get(token.text, self._first)
        self._first = self._first or group
        if group == self._first:
            return None
        message = f"BT.CPP before 4.9 refuses `{token.text}` ({group}) beside {self._first} without brackets"
        return Note(message, token.offset, token.end, "put one of them in brackets")


def order(before: Token, token: Token) -> Note | None:
    """Return a note about `a - b + c`, which 4.8 reads from the right."""
    if before.text not in {"-", "/"}:
        return None
    first, second = before.text, token.text
    message = f"BT.CPP before 4.9 reads `a {first} b {second} c` as `a {first} (b {second} c)`"
    return Note(message, token.offset, token.end, "put the first two in brackets")


def logic_order(token: Token) -> Note:
    """Return the note about `a || b && c`: to 4.8, both operators bind equally."""
    return Note("BT.CPP before 4.9 reads `a || b && c` as `(a || b) && c`", token.offset, token.end, "put `b && c` in brackets")


def trailing_semicolon(token: Token) -> Note:
    """Return the note about a `;` at the end."""
    return Note("BT.CPP before 4.9 refuses a `;` at the end", token.offset, token.end, "take it away")


def signed_number(token: Token) -> Note:
    """Return the note about `+2`."""
    return Note("BT.CPP since 4.9 refuses a `+` before a number", token.offset, token.end, "take it away")


def extended(statements: Sequence[Node]) -> bool:
    """Return whether a script uses what no BT.CPP reads: dotted names, calls."""
    nodes = (node for statement in statements for node in walk(statement))
    return any(isinstance(node, Call) or (isinstance(node, Name) and "." in node.name) for node in nodes)


_SINCE_4_9 = "BT.CPP since 4.9 refuses"
_BEFORE_4_9 = "BT.CPP before 4.9 refuses"


def of_tokens(text: str, tokens: Sequence[Token]) -> list[Note]:
    """Return the notes about how single words are written."""
    notes = [Note(f"{_SINCE_4_9} `\\` at a line's end", place, place + 1, "take it away") for place in _backslashes(text, tokens)]
    for token, following in pairwise(tokens):
        notes += [Note(message, token.offset, token.end, cure) for message, cure in _of_token(token, following)]
    return notes


def _of_token(token: Token, following: Token) -> Iterator[tuple[str, str]]:
    match token.kind:
        case Kind.STRING if not token.text.isascii():
            yield f"{_BEFORE_4_9} texts with other letters than ASCII's", "write it in ASCII"
        case Kind.STRING if token.text[0] == '"':
            yield f"{_SINCE_4_9} texts in double quotes", "take single quotes"
        case Kind.NUMBER if following.text == ".." and following.offset == token.end:
            yield f"{_BEFORE_4_9} `..` right behind a number", "put a space between"
        case Kind.NAME if not token.text.isascii():
            yield f"{_SINCE_4_9} names with other letters than ASCII's", "write it in ASCII"
        case Kind.NAME if token.text.startswith(("true", "false")) and token.text not in {"true", "false"}:
            yield f"{_BEFORE_4_9} names that begin with `true` or `false`", "name it otherwise"


def _backslashes(text: str, tokens: Sequence[Token]) -> Iterator[int]:
    for before, token in pairwise([Token(Kind.END, "", 0), *tokens]):
        if "\\" in text[before.end : token.offset]:
            yield text.index("\\", before.end)
