"""Indents a text by its braces, and nothing else: comments and the division into lines stay as they are."""

from __future__ import annotations

from alula.language.lexer import Source, tokenize

INDENT = "  "
_GOES_ON = frozenset({":", "=", "(", "and", "or", "not", "=>", "->", "==", "!="})
"""The last words of a line that go on in the next."""
_CONTINUES = frozenset({"and", "or", "=>", "->", "==", "!=", ")", "violation"})
"""The first words of a line that belong to the line before."""


def formatted(text: str) -> str:
    """Return a text with each line indented by its depth, without spaces at line ends and without double empty lines."""
    source = Source("", text)
    braces: dict[int, list[str]] = {}
    starts: dict[int, str] = {}
    ends: dict[int, str] = {}
    for token in tokenize(source):
        starts.setdefault(token.line, token.text)
        ends[token.line] = token.text
        if token.text in {"{", "}"}:
            braces.setdefault(token.line, []).append(token.text)
    lines: list[str] = []
    before = ""
    depth, comment = 0, False
    for number, line in enumerate(text.split("\n"), 1):
        # An entry that goes on in the next line is indented once more.
        shown = depth - 1 if starts.get(number) == "}" else depth + (before in _GOES_ON or starts.get(number) in _CONTINUES)
        before = ends.get(number, before)
        stripped = line.strip()
        # What stands within `/* ... */` keeps its own indentation.
        lines.append(line.rstrip() if comment or not stripped else f"{INDENT * max(0, shown)}{stripped}")
        comment = _in_comment(line, inside=comment)
        depth = max(0, depth + sum(1 if brace == "{" else -1 for brace in braces.get(number, ())))
    kept = [line for index, line in enumerate(lines) if line or (index and lines[index - 1])]
    return "\n".join(kept).rstrip("\n") + "\n"


def _in_comment(line: str, *, inside: bool) -> bool:
    """Return whether a `/* ... */` goes on behind this line."""
    while True:
        if inside:
            _, found, line = line.partition("*/")
            if not found:
                return True
            inside = False
        before, found, after = line.partition("/*")
        if not found or "//" in before or before.count('"') % 2:
            return False
        inside, line = True, after
