"""A skill of the Robot Language; skillsets/LANGUAGE.md, Skills and Grammar, has what goes beyond the language of the authors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from alula.language.lexer import Kind, Token
from alula.language.rl.bodies import outside, read_body, read_effect
from alula.language.syntax.conditions import bare_condition
from alula.language.syntax.cursor import Cursor
from alula.language.syntax.elements import one_or_block, read_parameter
from alula.language.syntax.quantities import duration, hold, setting
from alula.language.syntax.skill_reader import PURPOSES, SkillReader
from alula.model.model import (
    NO_EFFECT,
    Assignment,
    Effect,
    Interrupt,
    Invariant,
    Parameter,
    Precondition,
    Progress,
    Result,
    ResultKind,
    Skill,
)

BLOCKS = (
    "parameter",
    "input",
    "output",
    "effect",
    "precondition",
    "start",
    "invariant",
    "progress",
    "interrupt",
    "success",
    "failure",
    "result",
    *PURPOSES,
)


def read_skill(cursor: Cursor) -> Skill:
    """Read `name { ... }`, the part of a skill behind the word `skill`; what is wrong in it goes to the cursor's report."""
    name = cursor.name("the name of the skill")
    reader = _SkillReader(cursor)
    cursor.block(reader.member, lambda: outside(cursor), lambda: cursor.at(*BLOCKS))
    return reader.parts.build(name, cursor.source)


def _begins_block(cursor: Cursor) -> bool:
    """Return whether a line begins with `start r -> S`, `success ok {` or `input x: T`: an entry of no block begins with two names."""
    begins = cursor.here.text in BLOCKS and cursor.here.kind is Kind.NAME and cursor.here.line > cursor.previous.line
    return begins and cursor.ahead().kind is Kind.NAME and cursor.ahead(2).text in {"->", "{", ":"} and cursor.ahead().text != "guard"


class _SkillReader(SkillReader):
    """Reads the blocks of one skill in any order."""

    def __init__(self, cursor: Cursor) -> None:
        super().__init__(cursor, lambda: outside(cursor))
        self._nameless: Counter[str] = Counter()

    def member(self) -> None:
        """Read one block, or one entry without braces."""
        word = self.cursor.here
        if word.text in {"start", "progress", "interrupt", "achieves"} and word.kind is Kind.NAME:
            self.once(word)
        match word.text:
            case "parameter" | "input" | "output":
                self._several(self.value(word.text))
            case "effect":
                self.named_effects(self._several)
            case "precondition":
                self._several(self._precondition)
            case "start":
                self._start()
            case "invariant":
                self._invariants()
            case "progress":
                self._progress()
            case "interrupt":
                self._interrupt()
            case "success" | "failure" | "result":
                kind = ResultKind(word.text)
                self._several(lambda: self._result(kind))
            case "provides" | "needs" | "achieves":
                self.purpose(bare_condition)
            case _:
                raise self.unknown(word, BLOCKS)

    def _several(self, entry: Callable[[], None]) -> None:
        one_or_block(self.cursor, entry, lambda: self.outside() or _begins_block(self.cursor))

    # --- blocks ---------------------------------------------------------------------------------------------------

    def _precondition(self) -> None:
        """Read `name: condition`, or a condition alone, which is given a name."""
        first, cursor = self.cursor.here, self.cursor
        if first.kind is Kind.NAME and cursor.ahead().text == ":":
            name = cursor.name("a precondition").text
            cursor.advance()
        else:
            name = self._free_name("precondition")
        self.parts.preconditions.append(Precondition(name, bare_condition(cursor), span=cursor.span(first)))

    def _start(self) -> None:
        word = self.cursor.advance()
        changes: list[Assignment] = []
        self.cursor.accept(":", "=")
        reference = read_effect(self.cursor, changes)
        self.parts.start = reference or (Effect("", tuple(changes), span=self.cursor.span(word)) if changes else NO_EFFECT)

    def _invariants(self) -> None:
        """Read one invariant or a block of them; `{ guard ... }` is an only one without a name."""
        cursor = self.cursor
        following = cursor.ahead(2)
        if cursor.ahead().text == "{" and following.text == "guard" and cursor.ahead(3).text not in {":", "{"}:
            self._guarded(cursor.advance(), "")
            return
        self._several(self._invariant)

    def _invariant(self) -> None:
        """Read `name { guard C effect E }`, `name: C effect E`, `guard C effect E` or `C effect E`."""
        first, cursor = self.cursor.here, self.cursor
        if cursor.at("guard") and cursor.ahead().text not in {":", "{"}:
            self._guarded(first, "")
        elif first.kind is Kind.NAME and (cursor.ahead().text == "{" or cursor.ahead().text == "guard"):
            self._guarded(first, cursor.name("an invariant").text)
        else:
            name = ""
            if first.kind is Kind.NAME and cursor.ahead().text == ":":
                name = cursor.name("an invariant").text
                cursor.advance()
            condition, duration = bare_condition(cursor), hold(cursor)
            effect = read_body(cursor, ("effect",)).effect(cursor, first)
            self._add_invariant(Invariant(name, condition, effect, duration, span=cursor.span(first)))

    def _guarded(self, first: Token, name: str) -> None:
        cursor = self.cursor
        body = read_body(cursor, ("guard", "effect"))
        if body.condition is None:
            message = f"invariant `{name}` has no `guard`" if name else "this invariant has no `guard`"
            cursor.source.report("ALU103", message, cursor.span(first), hint="write `guard resource == STATE`")
            return
        effect = body.effect(cursor, first)
        self._add_invariant(Invariant(name, body.condition, effect, body.hold, span=cursor.span(first)))

    def _add_invariant(self, invariant: Invariant) -> None:
        name = invariant.name or self._free_name("invariant")
        held = Invariant(name, invariant.condition, invariant.effect, invariant.hold, span=invariant.span)
        self.parts.invariants.append(held)

    def _progress(self) -> None:
        """Read `{ period 1 sec  message x: T  deadline 5 s }`, `period 1 sec`, `1 sec` or `= 1`."""
        cursor = self.cursor
        reader = _ProgressReader(cursor)
        cursor.advance()
        if cursor.at("{"):
            cursor.block(reader.member, lambda: outside(cursor), lambda: cursor.at(*_PROGRESS))
        else:
            cursor.accept("=", ":")
            if cursor.here.kind is Kind.NUMBER:
                reader.period_s = duration(cursor)
            while cursor.at(*_PROGRESS) and not (cursor.at("output") and reader.closed):
                reader.member()
        self.parts.progress = reader.build()

    def _interrupt(self) -> None:
        word = self.cursor.advance()
        body = read_body(self.cursor, ("interrupting", "timeout", "effect", "postcondition"))
        effect = body.effect(self.cursor, word)
        self.parts.interrupt = Interrupt(body.interrupting, effect, body.postcondition, body.timeout_s, span=self.cursor.span(word))

    def _result(self, kind: ResultKind) -> None:
        cursor = self.cursor
        name = cursor.name("a result")
        cursor.accept(":")
        body = read_body(cursor, ("effect", "postcondition"))
        effect, comment = body.effect(cursor, name), cursor.previous.comment
        self.parts.results.append(Result(name.text, kind, effect, body.postcondition, comment, span=cursor.span(name)))

    def _free_name(self, stem: str) -> str:
        """Return a name for what was written without one; `check` reports it if another element has it."""
        self._nameless[stem] += 1
        number = self._nameless[stem]
        return stem if number == 1 else f"{stem}_{number}"


_PROGRESS = ("period", "message", "output", "deadline")


class _ProgressReader:
    """Reads the body of `progress`; `output` is the later word for `message`."""

    def __init__(self, cursor: Cursor) -> None:
        self.cursor = cursor
        self.first = cursor.here
        self.last = cursor.here
        self.period_s: float | None = None
        self.deadline_s: float | None = None
        self.message = ""
        self.outputs: list[Parameter] = []
        self.closed = True
        """Without braces `output` is not the progress's but the skill's."""

    def member(self) -> None:
        cursor = self.cursor
        if cursor.at("period"):
            if self.period_s is not None:
                cursor.source.report("ALU106", "`period` is given twice in this block", cursor.span(cursor.here))
            self.period_s = setting(cursor, "period")
            self.last = cursor.previous
        elif cursor.at("deadline"):
            self.deadline_s = setting(cursor, "deadline")
        elif cursor.at("message", "output"):
            self._message()
        else:
            raise cursor.fail(*(f"`{word}`" for word in _PROGRESS), "`}`")

    def build(self) -> Progress:
        """Return what was read; report a missing period."""
        span = self.cursor.span(self.first, self.last)
        if self.period_s is None:
            self.cursor.source.report("ALU103", "`progress` has no `period`", span, hint="write `period 1 sec`")
        period_s = 0.0 if self.period_s is None else self.period_s
        return Progress(period_s, self.message, self.deadline_s, tuple(self.outputs), span=span)

    def _message(self) -> None:
        """Read `message T`, `message x: T` or `message { x: T  y: U }`."""
        cursor = self.cursor
        if cursor.ahead().text == "{" or cursor.ahead(2).text == ":":
            one_or_block(cursor, lambda: self.outputs.append(read_parameter(cursor, "a value")), lambda: outside(cursor))
        else:
            cursor.advance()
            self.message = cursor.name("a type").text
