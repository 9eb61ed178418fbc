"""From a script's text to tokens."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum

from alula.trees.script.errors import ScriptError

MAX_CHARACTERS = 20_000
"""Scripts are attributes of a few dozen characters; a longer one is refused before it costs time."""


class Kind(Enum):
    """What a token is; its value is how a message calls it."""

    NAME = "a name"
    NUMBER = "a number"
    STRING = "a text"
    OPERATOR = "an operator"
    END = "the end of the script"


@dataclass(frozen=True, slots=True)
class Token:
    """A word of a script, with the place of its first character."""

    kind: Kind
    text: str
    offset: int

    @property
    def end(self) -> int:
        """The offset behind the token."""
        return self.offset + len(self.text)

    @property
    def shown(self) -> str:
        """The token as a message names it."""
        return Kind.END.value if self.kind is Kind.END else f"`{self.text[:40]}`"


_TOKEN = re.compile(
    r"""(?P<space>(?:[ \t\r\n\f\v]|\\\r?\n)+)
      | (?P<STRING>'[^']*'|"[^"]*")
      | (?P<open>['"])
      | (?P<NUMBER>0[xX][0-9a-fA-F]+|[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)
      | (?P<NAME>(?:@\w+|[^\W\d]\w*)(?:\.[^\W\d]\w*)*)
      | (?P<OPERATOR>:=|\+=|-=|\*=|/=|==|!=|<=|>=|&&|\|\||\.\.|[-+*/&|^~!<>=?:();,])
      | (?P<bad>.)""",
    re.VERBOSE | re.DOTALL,
)
_SUFFIX = re.compile(r"\.(?!\.)|\w")
"""What must not follow a number: BT.CPP refuses `3x`, `1.` and `0xg`."""

_CURES = {
    "%": "BT.CPP's scripts have no remainder",
    ".": "a number begins with a digit, a dotted name has no spaces",
    "{": "a script names an entry without braces: `entry`",
    "}": "a script names an entry without braces: `entry`",
    "[": "BT.CPP's scripts have no lists",
    "#": "BT.CPP's scripts have no comments",
}


def tokenize(text: str) -> list[Token]:
    """Return the tokens of a script, an END token last; raise ScriptError at the first text that is none."""
    if len(text) > MAX_CHARACTERS:
        message = f"a script of {len(text)} characters; there may be {MAX_CHARACTERS}"
        raise ScriptError(message, MAX_CHARACTERS, cure="divide it", excess=True)
    tokens: list[Token] = []
    for match in _TOKEN.finditer(text):
        group = match.lastgroup
        if group == "space":
            continue
        token = Token(Kind.OPERATOR if group in {"open", "bad"} else Kind[str(group)], match.group(), match.start())
        if group == "open":
            raise ScriptError("a text without its closing quote", token.offset, end=len(text), cure=f"close it with {token.text}")
        if group == "bad":
            raise ScriptError(f"{token.shown} means nothing in a script", token.offset, cure=_CURES.get(token.text, ""))
        if group == "NUMBER" and _SUFFIX.match(text, token.end):
            raise ScriptError(f"{token.shown} goes on with what is no part of a number", token.offset, end=token.end + 1)
        tokens.append(token)
    tokens.append(Token(Kind.END, "", len(text)))
    return tokens
