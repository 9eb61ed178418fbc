"""What the readers of both notations share: blocks that are given once, and effects with names."""

from __future__ import annotations

from collections.abc import Callable

from alula.common.suggestions import nearest
from alula.language.lexer import Kind, Token
from alula.language.syntax.cursor import Cursor, SyntaxFault
from alula.language.syntax.elements import one_or_block, read_change, read_parameter, read_role
from alula.language.syntax.skill_parts import SkillParts
from alula.model.expressions import Expression
from alula.model.model import Assignment, Effect, Role

PURPOSES = ("provides", "needs", "achieves")
"""The words by which a skill says what it is for."""


class SkillReader:
    """Reads the blocks of one skill in any order; ``outside`` tells that the `}` of a block is missing."""

    def __init__(self, cursor: Cursor, outside: Callable[[], bool]) -> None:
        self.cursor = cursor
        self.parts = SkillParts()
        self.outside = outside
        self._seen: set[str] = set()

    def once(self, word: Token) -> None:
        """Report a block that is given a second time."""
        if word.text in self._seen:
            hint = "a skill has one of each; put the entries together"
            self.cursor.source.report("ALU106", f"`{word.text}` is given twice in this skill", self.cursor.span(word), hint=hint)
        self._seen.add(word.text)

    def unknown(self, word: Token, blocks: tuple[str, ...]) -> SyntaxFault:
        """Return the error about a word that begins no block."""
        hint = nearest(word.text, blocks) if word.kind is Kind.NAME else ""
        return self.cursor.fail(*(f"`{block}`" for block in blocks), "`}`", hint=hint if hint.startswith("did") else "")

    def value(self, word: str) -> Callable[[], None]:
        """Return what reads one entry of `parameter`, `input` or `output`."""
        parts = self.parts
        several = {"parameter": parts.parameters, "input": parts.inputs, "output": parts.outputs}
        return lambda: several[word].append(read_parameter(self.cursor, f"{'a' if word == 'parameter' else 'an'} {word}"))

    def purpose(self, condition: Callable[[Cursor], Expression]) -> None:
        """Read `provides role`, `needs { role role }` or `achieves condition`."""
        word, parts = self.cursor.here.text, self.parts
        if word == "achieves":
            self.cursor.advance()
            self.cursor.accept(":")
            parts.achieves = condition(self.cursor)
            return
        roles: list[Role] = parts.provides if word == "provides" else parts.needs
        one_or_block(self.cursor, lambda: roles.append(read_role(self.cursor)), self.outside)

    def named_effects(self, read_all: Callable[[Callable[[], None]], None]) -> None:
        """Read the entries of an `effect` block by ``read_all``; note whether one of them could not be read."""
        before = len(self.cursor.source.diagnostics)
        read_all(self._named_effect)
        self.parts.effects_complete &= len(self.cursor.source.diagnostics) == before

    def _named_effect(self) -> None:
        """Read `name: r -> S` or `name { r -> S  q -> T }`."""
        name = self.cursor.name("the name of an effect")
        changes: list[Assignment] = []
        if self.cursor.accept(":"):
            changes.append(read_change(self.cursor))
        elif self.cursor.at("{"):
            changes += self.changes()
        else:
            raise self.cursor.fail("`:`", "`{`", hint=f"write `{name.text}: resource -> STATE` or `{name.text} {{}}`")
        self.parts.effects.append(Effect(name.text, tuple(changes), span=self.cursor.span(name)))

    def changes(self) -> list[Assignment]:
        """Read `{ r -> S  q -> T }`."""
        changes: list[Assignment] = []
        self.cursor.block(lambda: changes.append(read_change(self.cursor)), self.outside)
        return changes
