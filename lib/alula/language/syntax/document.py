"""A file: types that all its skillsets share, and skillsets with their types, data, resources, events, skills and properties.

The notations differ in how a skill and a condition are written; a ``Dialect`` says how.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import TypeVar

from alula.common.suggestions import nearest
from alula.language.errors import LanguageError
from alula.language.lexer import Kind, Source, Token
from alula.language.syntax.cursor import Cursor, SyntaxFault, starts_member
from alula.language.syntax.elements import one_or_block, read_changes, read_data, read_parameter
from alula.language.syntax.properties import read_property
from alula.language.syntax.resources import read_resource
from alula.model.expressions import TRUE, Expression
from alula.model.model import NO_EFFECT, Assignment, Data, Effect, Event, Parameter, Property, Resource, Skill, Skillset
from alula.model.span import Span

MEMBERS = ("use", "type", "parameter", "data", "resource", "event", "skill", "property")
_TOP = ("skillset", "type")
T = TypeVar("T", Event, Skill, Property)


@dataclass(frozen=True)
class Dialect:
    """What a notation has of its own: how a skill (from its name on) and a condition are read."""

    read_skill: Callable[[Cursor], Skill]
    condition: Callable[[Cursor], Expression]


@dataclass(frozen=True)
class TypeName:
    """A type that is declared outside of every skillset."""

    name: str
    span: Span


@dataclass(frozen=True)
class Document:
    """What a file holds.

    ``damaged`` tells that something of it could not be read and is missing; ``whole`` that what is missing is skills and events
    only, so that what is there can be judged without them.
    """

    types: tuple[TypeName, ...] = ()
    skillsets: tuple[Skillset, ...] = ()
    damaged: bool = False
    whole: bool = True


def read_document(source: Source, dialect: Dialect) -> Document:
    """Return what could be read of a source; its diagnostics have what could not."""
    cursor = Cursor(source)
    reader = _FileReader(cursor, dialect)
    if not (cursor.at_end and source.diagnostics):
        reader.read()
    document = Document(tuple(reader.types), tuple(reader.skillsets), bool(source.diagnostics), reader.whole)
    return replace(document, skillsets=tuple(_with_shared_types(document)))


def one_skillset(source: Source, document: Document) -> Skillset:
    """Return the only skillset of a document; raise LanguageError when there is anything wrong with it."""
    if not source.diagnostics and len(document.skillsets) != 1:
        message = f"expected one skillset, found {len(document.skillsets)}"
        source.report("ALU406", message, document.skillsets[1].span if document.skillsets else Span(source.file, 1, 1, 2))
    if source.diagnostics:
        raise LanguageError(sorted(source.diagnostics, key=lambda d: (d.span.line, d.span.column)))
    return document.skillsets[0]


class _FileReader:
    """Reads a file from its first to its last token."""

    def __init__(self, cursor: Cursor, dialect: Dialect) -> None:
        self.cursor = cursor
        self.dialect = dialect
        self.types: list[TypeName] = []
        self.skillsets: list[Skillset] = []
        self.whole = True

    def read(self) -> None:
        cursor = self.cursor
        if not cursor.at(*_TOP):
            # Some other file: one finding says so better than one for each of its characters.
            cursor.source.diagnostics.clear()
            self._fail()
            return
        while not cursor.at_end and not cursor.source.full:
            try:
                if cursor.at("skillset"):
                    self._skillset()
                elif cursor.at("type"):
                    one_or_block(cursor, self._type, lambda: starts_member(cursor, ("skillset",)))
                else:
                    # After an earlier error this is most likely the rest of what was not understood.
                    if not cursor.source.diagnostics:
                        self._fail()
                    self._skip()
            except SyntaxFault:
                self._skip()

    def _fail(self) -> None:
        self.whole = False
        hint = "a file holds `skillset name { ... }`, one or several, and `type Name`"
        self.cursor.fail("`skillset`", "`type`", hint=hint)

    def _skip(self) -> None:
        self.whole = False
        while not self.cursor.at_end and not (self.cursor.at("skillset") and self.cursor.ahead().kind is Kind.NAME):
            self.cursor.advance()

    def _type(self) -> None:
        name = self.cursor.name("the name of a type")
        self.types.append(TypeName(name.text, self.cursor.span(name)))

    def _skillset(self) -> None:
        self.cursor.advance()
        name = self.cursor.name("the name of the skillset")
        reader = _SkillsetReader(self.cursor, self.dialect)
        reader.read()
        self.whole &= reader.whole
        self.skillsets.append(reader.build(name))


@dataclass
class _Parts:
    uses: list[str] = field(default_factory=list)
    types: list[str] = field(default_factory=list)
    parameters: list[Parameter] = field(default_factory=list)
    data: list[Data] = field(default_factory=list)
    resources: list[Resource] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    skills: list[Skill] = field(default_factory=list)
    properties: list[Property] = field(default_factory=list)


class _SkillsetReader:
    """Reads the body of one skillset, its members in any order."""

    def __init__(self, cursor: Cursor, dialect: Dialect) -> None:
        self.cursor = cursor
        self.dialect = dialect
        self.parts = _Parts()
        self._told_in_parts = 0
        self._begun = len(cursor.source.diagnostics)

    @property
    def whole(self) -> bool:
        """Whatever is wrong is inside of skills, events and properties, which were left out."""
        return len(self.cursor.source.diagnostics) - self._begun == self._told_in_parts

    def read(self) -> None:
        """Read `<A, B> { member* }`; types in angle brackets are the older way to declare them."""
        cursor = self.cursor
        if cursor.accept("<"):
            while not cursor.accept(">"):
                self._name(self.parts.types, "the name of a type")
                cursor.accept(",")
        cursor.block(self._member, lambda: starts_member(cursor, ("skillset",)), self._begins_member)

    def build(self, name: Token) -> Skillset:
        parts = self.parts
        return Skillset(
            name=name.text,
            types=tuple(parts.types),
            parameters=tuple(parts.parameters),
            data=tuple(parts.data),
            resources=tuple(parts.resources),
            events=tuple(parts.events),
            skills=tuple(parts.skills),
            properties=tuple(parts.properties),
            uses=tuple(parts.uses),
            span=self.cursor.span(name),
        )

    def _begins_member(self) -> bool:
        return starts_member(self.cursor, MEMBERS)

    def _member(self) -> None:
        cursor, parts = self.cursor, self.parts
        match cursor.here.text:
            case "use":
                self._several(lambda: self._name(parts.uses, "the name of a skillset"))
            case "type":
                self._several(lambda: self._name(parts.types, "the name of a type"))
            case "parameter":
                self._several(lambda: parts.parameters.append(read_parameter(cursor, "a parameter")))
            case "data":
                self._several(lambda: parts.data.append(read_data(cursor)))
            case "resource":
                self._several(lambda: parts.resources.append(read_resource(cursor, self._begins_member)))
            case "event":
                self._several(lambda: self._unless_damaged(parts.events, self._event))
            case "skill":
                self._several(lambda: self._unless_damaged(parts.skills, lambda: self.dialect.read_skill(cursor)))
            case "property":
                self._several(lambda: self._unless_damaged(parts.properties, lambda: read_property(cursor)))
            case _:
                hint = nearest(cursor.here.text, MEMBERS) if cursor.here.kind is Kind.NAME else ""
                raise cursor.fail(*(f"`{word}`" for word in MEMBERS), "`}`", hint=hint if hint.startswith("did") else "")

    def _several(self, entry: Callable[[], None]) -> None:
        one_or_block(self.cursor, entry, self._begins_member)

    def _name(self, names: list[str], what: str) -> None:
        names.append(self.cursor.name(what).text)

    def _unless_damaged(self, found: list[T], read: Callable[[], T]) -> None:
        """Keep what ``read`` returns unless it told of something; nothing else refers to it, so that the rest can be judged."""
        diagnostics = self.cursor.source.diagnostics
        before = len(diagnostics)
        try:
            element = read()
        finally:
            self._told_in_parts += len(diagnostics) - before
        if len(diagnostics) == before:
            found.append(element)

    def _event(self) -> Event:
        """Read `name { guard C  effect r -> S }`; the braces may be missing."""
        cursor = self.cursor
        name = cursor.name("the name of an event")
        cursor.accept(":")
        reader = _EventReader(cursor, self.dialect.condition)
        if cursor.at("{"):
            cursor.block(reader.member, self._begins_member)
        else:
            reader.member()
            while cursor.at("guard", "effect") and cursor.ahead().text not in {":", "{"}:
                reader.member()
        effect = Effect("", tuple(reader.changes), span=cursor.span(name)) if reader.changes else NO_EFFECT
        return Event(name.text, reader.guard, effect, span=cursor.span(name))


class _EventReader:
    """Reads the body of one event."""

    def __init__(self, cursor: Cursor, condition: Callable[[Cursor], Expression]) -> None:
        self.cursor = cursor
        self.condition = condition
        self.guard: Expression = TRUE
        self.changes: list[Assignment] = []

    def member(self) -> None:
        cursor = self.cursor
        if cursor.accept("guard"):
            if self.guard is not TRUE:
                cursor.source.report("ALU106", "`guard` is given twice in this event", cursor.span(cursor.previous))
            cursor.accept(":")
            self.guard = self.condition(cursor)
        elif cursor.accept("effect"):
            read_changes(cursor, self.changes, lambda: starts_member(cursor, MEMBERS))
        else:
            raise cursor.fail("`guard`", "`effect`", "`}`")


def _with_shared_types(document: Document) -> list[Skillset]:
    """Give the types that a file declares outside of its skillsets to those that use them; to an only skillset all of them."""
    names = tuple(dict.fromkeys(shared.name for shared in document.types))
    if len(document.skillsets) == 1:
        return [replace(skillset, types=names + skillset.types) for skillset in document.skillsets]
    return [with_known_types(skillset, names) for skillset in document.skillsets]


def with_known_types(skillset: Skillset, names: Collection[str]) -> Skillset:
    """Add those of the names to a skillset's types that it uses and does not declare."""
    known, own = set(names), set(skillset.types)
    used = dict.fromkeys(element.type for element in typed_elements(skillset))
    added = tuple(name for name in used if name in known and name not in own)
    return replace(skillset, types=added + skillset.types) if added else skillset


def typed_elements(skillset: Skillset) -> list[Data | Parameter]:
    """Return everything of a skillset that has a type."""
    typed: list[Data | Parameter] = [*skillset.data, *skillset.parameters]
    for skill in skillset.skills:
        typed += [*skill.inputs, *skill.outputs, *skill.parameters]
        typed += skill.progress.outputs if skill.progress else ()
    return typed
