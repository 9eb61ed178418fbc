"""The occurrences of names in a file: every place of a name, and what the name stands for there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from alula.language.lexer import Kind, Source, Token, tokenize
from alula.language.models import ModelFile
from alula.model.expressions import DataIs, Expression, ResourceIs, SkillRuns, atoms
from alula.model.model import Effect, Resource, Skill, Skillset
from alula.model.ros_types import PRIMITIVES
from alula.model.span import Span

RESOURCE_WORDS = frozenset({"state", "initial", "transition", "extern", "all"})


@dataclass(frozen=True)
class Entity:
    """What a name stands for. ``owner`` is the resource of a state, the skill of an effect, the skillset of others."""

    kind: str
    name: str
    owner: tuple[str, ...] = ()


@dataclass(frozen=True)
class Occurrence:
    """A name at a place."""

    entity: Entity
    span: Span
    defining: bool = False


def occurrences(file: ModelFile) -> list[Occurrence]:
    """Return all names of a file that lead somewhere, in the order of the text."""
    finder = _Finder(file)
    found = {one.span: one for skillset in file.skillsets for one in finder.of_skillset(skillset)}
    found |= {one.span: one for one in finder.types()}
    return sorted(found.values(), key=lambda one: (one.span.line, one.span.column))


class _Finder:
    """Turns the places of the model's elements into those of single names."""

    def __init__(self, file: ModelFile) -> None:
        self._source = Source(file.path, file.text)
        self._tokens = tokenize(self._source)
        self._at: Mapping[tuple[int, int], int] = {(t.line, t.column): index for index, t in enumerate(self._tokens)}
        self._declared = {name for skillset in file.skillsets for name in skillset.types}

    def types(self) -> Iterator[Occurrence]:
        """Yield the declarations of types, within skillsets and outside."""
        for index, token in enumerate(self._tokens):
            if token.text != "type" or token.kind is not Kind.NAME or index + 1 >= len(self._tokens):
                continue
            braced = self._tokens[index + 1].text == "{"
            for name in self._tokens[index + (2 if braced else 1) :]:
                if name.kind is not Kind.NAME or name.text not in self._declared:
                    break
                yield Occurrence(Entity("type", name.text), self._source.span(name), defining=True)
                if not braced:
                    break

    def of_skillset(self, skillset: Skillset) -> Iterator[Occurrence]:
        """Yield all names within a skillset."""
        owner = (skillset.name,)
        yield from self._name(skillset.span, Entity("skillset", skillset.name), defining=True)
        yield from self._uses(skillset)
        for resource in skillset.resources:
            yield from self._resource(resource, owner)
        for data in skillset.data:
            yield from self._typed(data.span, Entity("data", data.name, owner), data.type)
        for event in skillset.events:
            yield from self._name(event.span, Entity("event", event.name, owner), defining=True)
            yield from self._condition(event.guard, owner)
            yield from self._changes(event.effect, owner)
        for skill in skillset.skills:
            yield from self._skill(skill, owner)
        for prop in skillset.properties:
            yield from self._name(prop.span, Entity("property", prop.name, owner), defining=True)
            yield from self._condition(prop.condition, owner)
            if prop.consequence is not None:
                yield from self._condition(prop.consequence, owner)

    def _uses(self, skillset: Skillset) -> Iterator[Occurrence]:
        """Yield the skillsets that one uses: `use a` or `use { a b }`."""
        begin, using = self._index(skillset.span), False
        for token in self._tokens[begin + 1 :] if begin is not None and skillset.uses else ():
            if token.text == "skillset":
                return
            if using and token.text in skillset.uses:
                yield Occurrence(Entity("skillset", token.text), self._source.span(token))
            using = token.text == "use" or (using and (token.text in {"{", ","} or token.text in skillset.uses))

    def _resource(self, resource: Resource, owner: tuple[str, ...]) -> Iterator[Occurrence]:
        yield from self._name(resource.span, Entity("resource", resource.name, owner), defining=True)
        begin, known, depth = self._index(resource.span), set(resource.states), 0
        seen: set[str] = set()
        for token in self._tokens[begin + 1 :] if begin is not None else ():
            depth += {"{": 1, "}": -1}.get(token.text, 0)
            if depth == 0:
                return
            if token.kind is Kind.NAME and token.text in known and token.text not in RESOURCE_WORDS:
                entity = Entity("state", token.text, (*owner, resource.name))
                yield Occurrence(entity, self._source.span(token), defining=token.text not in seen)
                seen.add(token.text)

    def _skill(self, skill: Skill, owner: tuple[str, ...]) -> Iterator[Occurrence]:
        inside = (*owner, skill.name)
        yield from self._name(skill.span, Entity("skill", skill.name, owner), defining=True)
        for kind, several in (("parameter", skill.parameters), ("input", skill.inputs), ("output", skill.outputs)):
            for one in several:
                yield from self._typed(one.span, Entity(kind, one.name, inside), one.type)
        for effect in skill.effects:
            yield from self._name(effect.span, Entity("effect", effect.name, inside), defining=True)
            yield from self._changes(effect, owner)
        for precondition in skill.preconditions:
            yield from self._name(precondition.span, Entity("precondition", precondition.name, inside), defining=True)
            yield from self._condition(precondition.condition, owner)
        for invariant in skill.invariants:
            yield from self._name(invariant.span, Entity("invariant", invariant.name, inside), defining=True)
            yield from self._condition(invariant.condition, owner)
        for role in skill.provides:
            yield from self._name(role.span, Entity("role", role.name), defining=True)
        for role in skill.needs:
            yield from self._name(role.span, Entity("role", role.name))
        yield from self._condition(skill.achieves, owner)
        for result in skill.results:
            yield from self._name(result.span, Entity("result", result.name, inside), defining=True)
        ends = [(skill.interrupt.effect, skill.interrupt.postcondition), *((r.effect, r.postcondition) for r in skill.results)]
        for effect in (skill.start, *(i.effect for i in skill.invariants), *(effect for effect, _ in ends)):
            if effect.name:
                yield from self._name(effect.span, Entity("effect", effect.name, inside))
            else:
                yield from self._changes(effect, owner)
        for _, postcondition in ends:
            yield from self._condition(postcondition, owner)

    # --- parts ----------------------------------------------------------------------------------------------------

    def _condition(self, condition: Expression, owner: tuple[str, ...]) -> Iterator[Occurrence]:
        for atom in atoms(condition):
            if isinstance(atom, ResourceIs):
                yield from self._state(atom.span, atom.resource, atom.state, owner)
            elif isinstance(atom, DataIs):
                yield from self._name(atom.span, Entity("data", atom.data, owner))
            elif isinstance(atom, SkillRuns):
                yield from self._name(atom.span, Entity("skill", atom.skill, owner))

    def _changes(self, effect: Effect, owner: tuple[str, ...]) -> Iterator[Occurrence]:
        for change in effect.assignments:
            yield from self._state(change.span, change.resource, change.target, owner)

    def _state(self, span: Span, resource: str, state: str, owner: tuple[str, ...]) -> Iterator[Occurrence]:
        """Yield `resource == STATE` or `resource -> STATE`."""
        yield from self._name(span, Entity("resource", resource, owner))
        yield from self._name(span, Entity("state", state, (*owner, resource)), offset=2)

    def _typed(self, span: Span, entity: Entity, kind: str) -> Iterator[Occurrence]:
        """Yield the occurrences in `name: Type`; types of the language itself are none."""
        yield from self._name(span, entity, defining=True)
        if kind not in PRIMITIVES:
            yield from self._name(span, Entity("type", kind), offset=2)

    def _index(self, span: Span) -> int | None:
        return self._at.get((span.line, span.column))

    def _name(self, span: Span, entity: Entity, *, offset: int = 0, defining: bool = False) -> Iterator[Occurrence]:
        """Yield the name that stands so many words behind a place, if it does."""
        index = self._index(span)
        if index is None or index + offset >= len(self._tokens):
            return
        token: Token = self._tokens[index + offset]
        if token.text == entity.name and token.kind is Kind.NAME:
            yield Occurrence(entity, self._source.span(token), defining)


def at(file: ModelFile, line: int, column: int) -> Occurrence | None:
    """Return the name at a place, 1-based."""
    covers: Callable[[Span], bool] = lambda span: span.line == line and span.column <= column <= span.end_column  # noqa: E731
    return next((one for one in occurrences(file) if covers(one.span)), None)
