"""A skill of the paper's notation (Listing 3); skillsets/LANGUAGE.md, Skills and Grammar, has what goes beyond the listing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from alula.language.lexer import Kind, Token
from alula.language.syntax.conditions import paper_condition
from alula.language.syntax.cursor import Cursor, starts_block, starts_member
from alula.language.syntax.elements import read_parameter
from alula.language.syntax.quantities import duration, hold, setting
from alula.language.syntax.skill_reader import PURPOSES, SkillReader
from alula.model.expressions import TRUE, Expression
from alula.model.model import NO_EFFECT, Effect, Interrupt, Invariant, Parameter, Precondition, Progress, Result, ResultKind, Skill

BLOCKS = ("progress", "parameter", "input", "output", "effect", "precondition", "invariant", "interrupt", "result", *PURPOSES)
_OUTSIDE = ("resource", "event", "skill", "property")


def read_skill(cursor: Cursor) -> Skill:
    """Read `name { ... }`, the part of a skill behind the word `skill`; what is wrong in it goes to the cursor's report."""
    name = cursor.name("the name of the skill")
    reader = _SkillReader(cursor)
    cursor.block(reader.member, lambda: starts_member(cursor, _OUTSIDE), lambda: ends_block(cursor))
    return reader.parts.build(name, cursor.source)


def ends_block(cursor: Cursor) -> bool:
    """Return whether something begins that can't stand inside a block of a skill: the block's `}` is missing."""
    progress = cursor.at("progress") and cursor.ahead().text == "=" and cursor.ahead(2).kind is Kind.NUMBER
    return progress or starts_block(cursor, BLOCKS) or starts_member(cursor, _OUTSIDE)


class _SkillReader(SkillReader):
    """Reads the blocks of one skill in any order."""

    def __init__(self, cursor: Cursor) -> None:
        super().__init__(cursor, lambda: ends_block(cursor))

    def member(self) -> None:
        """Read one block, or `progress = 0.5`."""
        word = self.cursor.here
        if word.text in BLOCKS and word.kind is Kind.NAME:
            self.once(word)
        match word.text:
            case "progress":
                self._progress()
            case "parameter" | "input" | "output":
                self._block(self.value(word.text))
            case "effect":
                self.named_effects(self._block)
            case "precondition":
                self._block(self._precondition)
            case "invariant":
                self._block(self._invariant)
            case "interrupt":
                self._block(self._interrupt)
            case "result":
                self._block(self._result)
            case "provides" | "needs" | "achieves":
                self.purpose(paper_condition)
            case _:
                raise self.unknown(word, BLOCKS)

    # --- blocks ---------------------------------------------------------------------------------------------------

    def _block(self, entry: Callable[[], None]) -> None:
        self.cursor.advance()
        self.cursor.block(entry, self.outside)

    def _progress(self) -> None:
        """Read `progress = 0.5`, and what may follow it: `deadline = 5`, `message T` or `message { x: T }`."""
        cursor = self.cursor
        first = cursor.advance()
        cursor.expect("=", hint="write `progress = 0.5`, the period in seconds")
        period, deadline, message, outputs = duration(cursor), None, "", list[Parameter]()
        span = cursor.span(first, cursor.previous)
        if cursor.at("deadline"):
            deadline = setting(cursor, "deadline")
        while cursor.at("message"):
            cursor.advance()
            if cursor.at("{"):
                cursor.block(lambda: outputs.append(read_parameter(cursor, "a value")), self.outside)
            else:
                message = cursor.name("a type").text
        self.parts.progress = Progress(period, message, deadline, tuple(outputs), span=span)

    def _precondition(self) -> None:
        if self.cursor.at_word("success"):
            word = self.cursor.advance()
            if self.parts.start is not NO_EFFECT:
                self.cursor.source.report("ALU106", "`success` is given twice in this precondition", self.cursor.span(word))
            self.parts.start = self._reference()
            return
        name, holds = self._named_condition("a precondition")
        self.parts.preconditions.append(Precondition(name.text, holds, span=self.cursor.span(name)))

    def _invariant(self) -> None:
        name, holds = self._named_condition("an invariant")
        duration = hold(self.cursor)
        effect = self._setting("violation") if self.cursor.at_word("violation") else NO_EFFECT
        self.parts.invariants.append(Invariant(name.text, holds, effect, duration, span=self.cursor.span(name)))

    def _interrupt(self) -> None:
        if not any(self.cursor.at_word(word) for word in ("apply", "post", "interrupting", "timeout")):
            raise self.cursor.fail("`interrupting`", "`timeout`", "`apply`", "`post`", "`}`")
        word = self.cursor.here
        interrupt = self.parts.interrupt
        if self.cursor.accept("interrupting"):
            given = self.cursor.accept("true", "false")
            interrupting = given is None or given.text == "true"
            self.parts.interrupt = replace(interrupt, interrupting=interrupting, span=self.cursor.span(word))
            return
        if self.cursor.at("timeout"):
            if interrupt.timeout_s is not None:
                self.cursor.source.report("ALU106", "`timeout` is given twice in this block", self.cursor.span(word))
            timeout_s = setting(self.cursor, "timeout")
            self.parts.interrupt = replace(interrupt, timeout_s=timeout_s, span=self.cursor.span(word))
            return
        twice = interrupt.effect is not NO_EFFECT if word.text == "apply" else interrupt.postcondition is not TRUE
        if twice:
            self.cursor.source.report("ALU106", f"`{word.text}` is given twice in this block", self.cursor.span(word))
        effect, postcondition = self._outcome()
        self.parts.interrupt = Interrupt(
            interrupting=interrupt.interrupting,
            effect=effect if effect is not NO_EFFECT else interrupt.effect,
            postcondition=postcondition if postcondition is not TRUE else interrupt.postcondition,
            timeout_s=interrupt.timeout_s,
            span=self.cursor.span(word),
        )

    def _result(self) -> None:
        kind = self._result_kind()
        name = self.cursor.name("a result")
        effect, postcondition = self._outcome() if self.cursor.accept(":") else (NO_EFFECT, TRUE)
        comment = self.cursor.previous.comment
        self.parts.results.append(Result(name.text, kind, effect, postcondition, comment, span=self.cursor.span(name)))

    def _result_kind(self) -> ResultKind:
        """Read `success` or `failure` where a result's name follows on its line (they may be names of results themselves)."""
        following = self.cursor.ahead()
        if self.cursor.at("success", "failure") and following.kind is Kind.NAME and following.line == self.cursor.here.line:
            return ResultKind(self.cursor.advance().text)
        return ResultKind.PLAIN

    def _outcome(self) -> tuple[Effect, Expression]:
        """Read `apply = effect`, `post condition`, both or none."""
        effect = self._setting("apply") if self.cursor.at_word("apply") else NO_EFFECT
        if not self.cursor.at_word("post"):
            return effect, TRUE
        self.cursor.advance()
        return effect, paper_condition(self.cursor)

    def _named_condition(self, what: str) -> tuple[Token, Expression]:
        name = self.cursor.name(what)
        self.cursor.expect(":", hint=f"{what} is written `name: resource = (...)`")
        return name, paper_condition(self.cursor)

    def _setting(self, word: str) -> Effect:
        self.cursor.expect(word)
        self.cursor.expect("=")
        return self._reference()

    def _reference(self) -> Effect:
        """Read the name of an effect, or the changes themselves in braces."""
        if self.cursor.at("{"):
            first, changes = self.cursor.here, self.changes()
            return Effect("", tuple(changes), span=self.cursor.span(first))
        name = self.cursor.name("the name of an effect")
        return Effect(name.text, span=self.cursor.span(name))
