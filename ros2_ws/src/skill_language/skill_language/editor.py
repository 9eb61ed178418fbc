"""What an editor asks about a file: the names that may come next, what a name stands for, and where it is defined.

The file may be broken at the cursor, as it is while somebody writes: names are then taken from what could be read, and from the
words around the cursor.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from skill_language.lexer import Kind, Source, Token, tokenize
from skill_language.models import ModelFile
from skill_language.notation import Notation, notation_of
from skill_language.paper import skill as paper_skill
from skill_language.rl import skill as rl_skill
from skill_language.syntax.document import MEMBERS
from skill_language.syntax.resources import occurring
from skill_model.model import Data, Effect, Parameter, Resource, Skill, Skillset, Span, Transition

Element = Resource | Skill | Effect | Data | Parameter


@dataclass(frozen=True)
class Place:
    """A place between two characters: 1-based line, and 1-based column of the character behind it."""

    line: int
    column: int


@dataclass(frozen=True)
class Word:
    """A name in the text; ``resource`` is what stands before `==`, `!=` or `->` on its left, or is empty."""

    text: str
    line: int
    column: int
    resource: str = ""


@dataclass(frozen=True)
class Completion:
    """A name that may be put in; ``kind`` is state, resource, skill, effect, data, type or keyword."""

    label: str
    kind: str
    detail: str = ""


def completions(file: ModelFile, place: Place) -> list[Completion]:
    """Return what may stand at a place: states behind `resource ==` and `resource ->`, else names and the words of the notation."""
    before = _tokens_before(file, place)
    if before and _touches(before[-1], place) and before[-1].kind is Kind.NAME:
        before.pop()
    known = _Names(file)
    if len(before) > 1 and before[-1].text in {"==", "!=", "->"}:
        resource = known.resources.get(before[-2].text)
        return [Completion(state, "state", f"state of {resource.name}") for state in resource.states] if resource else []
    if before and before[-1].text == ":":
        return [Completion(name, "type") for name in known.types] + known.named()
    return known.named() + [Completion(word, "keyword") for word in _keywords(file)]


def word_at(file: ModelFile, place: Place) -> Word | None:
    """Return the name at a place, if there is one."""
    tokens = tokenize(Source(file.path, file.text))
    for index, token in enumerate(tokens):
        if token.kind is Kind.NAME and token.line == place.line and token.column <= place.column <= token.column + len(token.text):
            related = index > 1 and tokens[index - 1].text in {"==", "!=", "->"}
            return Word(token.text, token.line, token.column, tokens[index - 2].text if related else "")
    return None


def description(file: ModelFile, word: Word) -> str:
    """Return a resource with its states and arrows, a skill with its inputs, outputs and results, or another name's definition."""
    known = _Names(file)
    if word.resource in known.resources and word.text in known.resources[word.resource].states:
        return _state(known.resources[word.resource], word.text)
    match known.find(word):
        case Resource() as resource:
            return _resource(resource)
        case Skill() as skill:
            return _skill(skill)
        case Effect() as effect:
            return f"effect {effect.name} {{ {'  '.join(f'{c.resource} -> {c.target}' for c in effect.assignments)} }}"
        case Data() as data:
            return f"data {data.name}: {data.type}" + (f" period {data.period_s:g} s" if data.period_s is not None else "")
        case Parameter() as parameter:
            return f"{parameter.name}: {parameter.type}" + (f" // {parameter.comment}" if parameter.comment else "")
        case _:
            return ""


def definition(file: ModelFile, word: Word) -> Span | None:
    """Return where a name is defined; a state where its resource names it first."""
    known = _Names(file)
    if word.resource in known.resources:
        return _state_place(file, known.resources[word.resource], word.text)
    found = known.find(word)
    if found is not None:
        return found.span
    return known.type_place(word.text)


class _Names:
    """The names of a file, of all its skillsets together."""

    def __init__(self, file: ModelFile) -> None:
        self.file = file
        self.skillsets: tuple[Skillset, ...] = file.skillsets
        self.resources = {resource.name: resource for skillset in self.skillsets for resource in skillset.resources}
        self.skills = {skill.name: skill for skillset in self.skillsets for skill in skillset.skills}
        self.data = {data.name: data for skillset in self.skillsets for data in skillset.data}
        self.types = list(dict.fromkeys(name for skillset in self.skillsets for name in skillset.types))

    def named(self) -> list[Completion]:
        """Return resources, data, skills and the effects of all skills."""
        found = [Completion(r.name, "resource", " ".join(r.states)) for r in self.resources.values()]
        found += [Completion(d.name, "data", d.type) for d in self.data.values()]
        found += [Completion(s.name, "skill") for s in self.skills.values()]
        effects = {effect.name: skill.name for skill in self.skills.values() for effect in skill.effects}
        return found + [Completion(name, "effect", f"effect of {skill}") for name, skill in effects.items()]

    def find(self, word: Word) -> Element | None:
        """Return what a name stands for: in the skill that it stands in first, then in the skillset."""
        skill = self._skill_around(word.line)
        for element in self._of_skill(skill) if skill else ():
            if element.name == word.text:
                return element
        return self.resources.get(word.text) or self.skills.get(word.text) or self.data.get(word.text)

    def type_place(self, name: str) -> Span | None:
        """Return where a type is declared."""
        for match in re.finditer(rf"\btype\s*(?:\{{[^}}]*?)?\b({re.escape(name)})\b", self.file.text):
            line = self.file.text.count("\n", 0, match.start(1)) + 1
            column = match.start(1) - self.file.text.rfind("\n", 0, match.start(1))
            return Span(self.file.path, line, column, column + len(name))
        return None

    def _skill_around(self, line: int) -> Skill | None:
        before = [skill for skill in self.skills.values() if skill.span.line <= line]
        return max(before, key=lambda skill: skill.span.line, default=None)

    @staticmethod
    def _of_skill(skill: Skill) -> Iterator[Element]:
        yield from skill.effects
        yield from (*skill.inputs, *skill.outputs, *skill.parameters)


def _tokens_before(file: ModelFile, place: Place) -> list[Token]:
    tokens = tokenize(Source(file.path, file.text))
    return [t for t in tokens if t.kind is not Kind.END and (t.line, t.column) < (place.line, place.column)]


def _touches(token: Token, place: Place) -> bool:
    return token.line == place.line and token.column + len(token.text) >= place.column


def _keywords(file: ModelFile) -> list[str]:
    paper = notation_of(file.path, file.text) is Notation.PAPER
    own = (*paper_skill.BLOCKS, "violation", "apply", "post") if paper else (*rl_skill.BLOCKS, "guard", "postcondition", "interrupting")
    words = ("skillset", *MEMBERS, *own, "state", "initial", "transition", "extern", "and", "or", "not", "true", "false")
    return list(dict.fromkeys(words))


def _resource(resource: Resource) -> str:
    lines = [f"resource {resource.name} {{", f"  state {{ {' '.join(resource.states)} }}", f"  initial {resource.initial}"]
    if resource.all_transitions:
        lines.append("  transition all")
    arrows = [arrow for arrow in resource.transitions if arrow.extern or not resource.all_transitions]
    return "\n".join([*lines, *(f"  {_arrow(arrow)}" for arrow in arrows), "}"])


def _state(resource: Resource, state: str) -> str:
    arrows = [arrow for arrow in resource.transitions if state in {arrow.source, arrow.target} and arrow.source != arrow.target]
    return "\n".join([f"{resource.name} == {state}", *(f"  {_arrow(arrow)}" for arrow in arrows)])


def _arrow(arrow: Transition) -> str:
    return f"{'extern ' if arrow.extern else ''}{arrow.source} -> {arrow.target}"


def _skill(skill: Skill) -> str:
    inputs = ", ".join(f"{p.name}: {p.type}" for p in skill.inputs)
    outputs = ", ".join(f"{p.name}: {p.type}" for p in skill.outputs)
    lines = [f"skill {skill.name}({inputs})" + (f" -> ({outputs})" if outputs else "")]
    lines += [f"  {result.kind.value} {result.name}" for result in skill.results]
    return "\n".join(lines)


def _state_place(file: ModelFile, resource: Resource, state: str) -> Span | None:
    """Return the first place behind the resource's name that names the state: `state { ... }`, `initial` or an arrow."""
    if state not in resource.states and state not in occurring(resource.initial, resource.transitions):
        return None
    for token in tokenize(Source(file.path, file.text)):
        behind = (token.line, token.column) > (resource.span.line, resource.span.column)
        if behind and token.kind is Kind.NAME and token.text == state:
            return Span(file.path, token.line, token.column, token.column + len(state))
    return None
