"""A whole skillset of the paper's notation: types, data, resources (Listings 1 and 2) and skills."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from skill_language.errors import LanguageError, nearest
from skill_language.lexer import Kind, Source, Token, number
from skill_language.model import Data, Resource, Skill, Skillset, Transition
from skill_language.paper.cursor import Cursor, SyntaxFault, starts_member
from skill_language.paper.skill import MEMBERS, read_skill


@dataclass
class _Parts:
    types: list[str] = field(default_factory=list)
    data: list[Data] = field(default_factory=list)
    resources: list[Resource] = field(default_factory=list)
    skills: list[Skill] = field(default_factory=list)


def parse(text: str, file: str = "") -> Skillset:
    """Return the skillset written in ``text``.

    Raises:
        LanguageError: with everything that is wrong with the notation. Meaning is judged by ``check``, except that an
            effect that is referred to must exist, for else there is nothing to put into the model.
    """
    source = Source(file, text)
    cursor = Cursor(source)
    if cursor.at_end and source.diagnostics:
        raise LanguageError(source.diagnostics)
    if not cursor.at("skillset") and not cursor.at_end:
        # Some other file: one finding says so better than one for each of its characters.
        source.diagnostics.clear()
    skillset = _read(cursor)
    if source.diagnostics or skillset is None:
        raise LanguageError(sorted(source.diagnostics, key=lambda d: (d.span.line, d.span.column)))
    return skillset


def _read(cursor: Cursor) -> Skillset | None:
    parts = _Parts()
    try:
        cursor.expect("skillset", hint="a file holds one `skillset name { ... }`")
        name = cursor.name("the name of the skillset")
        cursor.block(lambda: _member(cursor, parts), lambda: starts_member(cursor, ("skillset",)))
        if not cursor.at_end and not cursor.source.diagnostics:
            raise cursor.fail("the end of the file", hint="a file holds one skillset; put another one into its own file")
    except SyntaxFault:
        return None
    return Skillset(
        name=name.text,
        types=tuple(parts.types),
        data=tuple(parts.data),
        resources=tuple(parts.resources),
        skills=tuple(parts.skills),
        span=cursor.span(name),
    )


def _member(cursor: Cursor, parts: _Parts) -> None:
    match cursor.here.text:
        case "type":
            _one_or_block(cursor, lambda: parts.types.append(cursor.name("the name of a type").text))
        case "data":
            _one_or_block(cursor, lambda: parts.data.append(_data(cursor)))
        case "resource":
            parts.resources.append(read_resource(cursor))
        case "skill":
            parts.skills.append(read_skill(cursor))
        case _:
            hint = nearest(cursor.here.text, MEMBERS) if cursor.here.kind is Kind.NAME else ""
            raise cursor.fail(*(f"`{word}`" for word in MEMBERS), "`}`", hint=hint if hint.startswith("did") else "")


def _one_or_block(cursor: Cursor, entry: Callable[[], None]) -> None:
    cursor.advance()
    if cursor.at("{"):
        cursor.block(entry, lambda: starts_member(cursor, MEMBERS))
    else:
        entry()


def _data(cursor: Cursor) -> Data:
    """Read `name: Type period = 0.5`; the period may be missing."""
    name = cursor.name("the name of data")
    cursor.expect(":", hint="data is written `name: Type period = 0.5`")
    kind = cursor.name("a type")
    period: float | None = None
    if cursor.at("period") and cursor.ahead().text == "=":
        cursor.advance()
        cursor.expect("=")
        period = number(cursor.source, cursor.kind(Kind.NUMBER))
    return Data(name.text, kind.text, period, span=cursor.span(name, kind))


def read_resource(cursor: Cursor) -> Resource:
    """Read `resource name { initial S  A -> B  extern B -> C }`."""
    cursor.expect("resource")
    name = cursor.name("the name of the resource")
    reader = _ResourceReader(cursor)
    cursor.block(reader.member, lambda: starts_member(cursor, MEMBERS))
    return reader.build(name)


class _ResourceReader:
    """Reads the body of one resource.

    States are those of `state { A B }` where it is given, else those that occur, the initial one first.
    """

    def __init__(self, cursor: Cursor) -> None:
        self.cursor = cursor
        self.states: list[str] | None = None
        self.initial = ""
        self.transitions: list[Transition] = []
        self.all = False

    def member(self) -> None:
        """Read one line of the body."""
        cursor = self.cursor
        if cursor.at_word("state") and cursor.ahead().text == "{":
            self._states()
        elif cursor.at_word("transition"):
            cursor.advance()
            cursor.expect("all", hint="an arrow is written `A -> B`; `transition all` allows every one")
            self.all = True
        elif cursor.at_word("initial"):
            self._initial()
        elif cursor.at_word("extern"):
            cursor.advance()
            self._arrow(extern=True)
        else:
            self._arrow(extern=False)

    def build(self, name: Token) -> Resource:
        """Put the parts together."""
        arrows = tuple(self.transitions)
        states = tuple(self.states) if self.states is not None else occurring(self.initial, arrows)
        if self.all:
            arrows += tuple(arrow for arrow in every_arrow(states) if arrow not in arrows)
        return Resource(name.text, states, self.initial, arrows, self.all, span=self.cursor.span(name))

    def _states(self) -> None:
        word = self.cursor.advance()
        if self.states is not None:
            self.cursor.source.report("ALU106", "`state` is given twice in this resource", self.cursor.span(word))
        states: list[str] = []
        self.cursor.block(lambda: states.append(self.cursor.name("a state").text), lambda: starts_member(self.cursor, MEMBERS))
        self.states = states

    def _initial(self) -> None:
        word = self.cursor.advance()
        if self.initial:
            self.cursor.source.report("ALU106", "`initial` is given twice in this resource", self.cursor.span(word))
        self.initial = self.cursor.name("a state").text

    def _arrow(self, *, extern: bool) -> None:
        if self.cursor.here.kind is not Kind.NAME:
            raise self.cursor.fail("a state", "`initial`", "`extern`", "`}`")
        source = self.cursor.name("a state")
        self.cursor.expect("->", hint="an arrow is written `A -> B` or `extern A -> B`")
        target = self.cursor.name("a state")
        self.transitions.append(Transition(source.text, target.text, extern, span=self.cursor.span(source, target)))


def occurring(initial: str, transitions: tuple[Transition, ...]) -> tuple[str, ...]:
    """Return the states that occur, the initial one first, then in the order of the arrows."""
    names = [initial] if initial else []
    for transition in transitions:
        names += [transition.source, transition.target]
    return tuple(dict.fromkeys(names))


def every_arrow(states: tuple[str, ...]) -> tuple[Transition, ...]:
    """Return what `transition all` stands for: each state to each other, for the functional layer and for skills."""
    pairs = [(source, target) for source in states for target in states if source != target]
    return tuple(Transition(source, target, extern) for source, target in pairs for extern in (False, True))
