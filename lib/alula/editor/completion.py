"""What may come next at a place, from the words before it: the line may be broken, as it is while it is written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from alula.language.lexer import Kind, Source, Token, tokenize
from alula.language.models import ModelFile
from alula.language.notation import Notation, notation_of
from alula.language.paper import skill as paper_skill
from alula.language.rl import skill as rl_skill
from alula.language.syntax.document import MEMBERS
from alula.model.model import Resource
from alula.model.ros_types import PRIMITIVES

PROPERTY_WORDS = ("never", "always", "eventually")
CONDITION_WORDS = ("and", "or", "not", "true", "false")
RESOURCE_WORDS = ("state", "initial", "transition", "extern", "all")
TYPED_BLOCKS = frozenset({"input", "output", "parameter", "data", "message"})


@dataclass(frozen=True)
class Place:
    """A place between two characters: 1-based line, and 1-based column of the character behind it."""

    line: int
    column: int


@dataclass(frozen=True)
class Completion:
    """A name that may be put in; ``kind`` is state, resource, skill, effect, data, type, role or keyword."""

    label: str
    kind: str
    detail: str = ""


def completions(file: ModelFile, place: Place) -> list[Completion]:
    """Return what may stand at a place."""
    return list({one.label: one for one in reversed([*_Context(file, place).candidates()])}.values())[::-1]


class _Context:
    """The blocks around a place, and the words of its entry before it."""

    def __init__(self, file: ModelFile, place: Place) -> None:
        self._file = file
        self._paper = notation_of(file.path, file.text) is Notation.PAPER
        self._tokens = [token for token in tokenize(Source(file.path, file.text)) if token.kind is not Kind.END]
        before = [token for token in self._tokens if (token.line, token.column) < (place.line, place.column)]
        if before and _touches(before[-1], place) and before[-1].kind is Kind.NAME:
            before.pop()
        self._before = before
        self._blocks = _blocks(before)
        self._resources: Mapping[str, Resource] = {r.name: r for skillset in file.skillsets for r in skillset.resources}

    def candidates(self) -> Iterator[Completion]:
        """Yield what may stand here, the likely first."""
        last = self._before[-1].text if self._before else ""
        if last in {"==", "!="} or (last == "->" and self._inside("resource") is None):
            yield from self._states(self._before[-2].text if len(self._before) > 1 else "")
        elif (resource := self._inside("resource")) is not None:
            yield from self._states(resource)
            # The resource may be one that can't be read yet.
            yield from (Completion(name, "state", f"state of {resource}") for name in self._names_in(resource))
            yield from _words(RESOURCE_WORDS)
        elif last == "." and self._before:
            return
        elif last == ":" and self._innermost() in TYPED_BLOCKS:
            yield from self._types()
        elif self._names_effect(last):
            yield from self._effects()
            if not self._paper:
                yield from self._named("resource")
        elif last in _ROLE_WORDS or self._innermost() in _ROLE_WORDS:
            yield from self._roles()
        elif self._innermost() == "property":
            yield from self._property_words(last)
        elif last == ":" and self._innermost() == "effect":
            yield from self._named("resource")
        else:
            yield from self._anything()

    # --- what stands around -----------------------------------------------------------------------------------------

    def _innermost(self) -> str:
        """Return the word that this entry belongs to: of the innermost block, or of an entry without braces on its line."""
        line = self._before[-1].line if self._before else 0
        for token in reversed(self._before):
            if token.line != line or token.text in {"{", "}"}:
                break
            if token.text in {*TYPED_BLOCKS, "property", "effect", "precondition", "invariant"}:
                return token.text
        return next((words[0].text for words in reversed(self._blocks) if words and words[0].text in _BLOCK_WORDS), "")

    def _inside(self, word: str) -> str | None:
        """Return the name of the innermost block that begins with a word, if we are in one."""
        for words in reversed(self._blocks):
            if len(words) > 1 and words[0].text == word:
                return words[1].text
            if words and words[0].text in {"skill", "event", "skillset"}:
                return None
        return None

    def _names_effect(self, last: str) -> bool:
        """Return whether the name of an effect comes next."""
        words = [token.text for token in self._before[-2:]]
        if self._paper:
            return words in (["violation", "="], ["apply", "="]) or (last == "success" and self._innermost() == "precondition")
        return last in {"effect", "start"} or (words[:1] in (["effect"], ["start"]) and last in {":", "="})

    # --- what there is ----------------------------------------------------------------------------------------------

    def _states(self, resource: str) -> Iterator[Completion]:
        known = self._resources.get(resource)
        for state in known.states if known else ():
            yield Completion(state, "state", f"state of {resource}")

    def _names_in(self, resource: str) -> Iterator[str]:
        """Yield the words of a resource's block, by braces alone."""
        words = [token.text for token in self._tokens]
        begin = next((i for i in range(len(words) - 2) if words[i : i + 3] == ["resource", resource, "{"]), len(words))
        depth = 0
        for token in self._tokens[begin + 2 :]:
            depth += {"{": 1, "}": -1}.get(token.text, 0)
            if depth == 0:
                return
            if token.kind is Kind.NAME and token.text not in RESOURCE_WORDS:
                yield token.text

    def _types(self) -> Iterator[Completion]:
        for name in dict.fromkeys(name for skillset in self._file.skillsets for name in skillset.types):
            yield Completion(name, "type")
        for name in PRIMITIVES:
            yield Completion(name, "type", "ROS primitive")

    def _property_words(self, last: str) -> Iterator[Completion]:
        if last == ":":
            yield from _words(PROPERTY_WORDS)
        elif last == "leads":
            yield Completion("to", "keyword")
            return
        elif last == "assuming":
            yield Completion("termination", "keyword")
            return
        yield from self._named("resource")
        yield from self._named("skill")
        yield from _words(("running", *CONDITION_WORDS, "leads to", "assuming termination"))

    def _effects(self) -> Iterator[Completion]:
        skill = self._inside("skill")
        for name in _effect_names(self._tokens, skill):
            yield Completion(name, "effect", f"effect of {skill}")

    def _roles(self) -> Iterator[Completion]:
        skills = (skill for skillset in self._file.skillsets for skill in skillset.skills)
        yield from (Completion(role.name, "role", "role") for skill in skills for role in (*skill.provides, *skill.needs))

    def _named(self, kind: str) -> Iterator[Completion]:
        if kind == "resource":
            yield from (Completion(r.name, "resource", " ".join(r.states)) for r in self._resources.values())
        for skillset in self._file.skillsets:
            if kind == "data":
                yield from (Completion(data.name, "data", data.type) for data in skillset.data)
            if kind == "skill":
                yield from (Completion(skill.name, "skill") for skill in skillset.skills)

    def _anything(self) -> Iterator[Completion]:
        for kind in ("resource", "data", "skill"):
            yield from self._named(kind)
        yield from self._effects()
        own = (*paper_skill.BLOCKS, "violation", "apply", "post") if self._paper else (*rl_skill.BLOCKS, *_RL_WORDS)
        yield from _words(("skillset", *MEMBERS, *own, *CONDITION_WORDS))


_RL_WORDS = ("guard", "postcondition", "interrupting")
_ROLE_WORDS = frozenset({"provides", "needs"})
_BLOCK_WORDS = frozenset({*MEMBERS, *paper_skill.BLOCKS, *rl_skill.BLOCKS, "message"})


def _words(words: Sequence[str]) -> Iterator[Completion]:
    return (Completion(word, "keyword") for word in words)


def _touches(token: Token, place: Place) -> bool:
    return token.line == place.line and token.column + len(token.text) >= place.column


def _blocks(tokens: Sequence[Token]) -> list[list[Token]]:
    """Return for each open brace the words before it on its entry, from outside to inside."""
    stack: list[list[Token]] = []
    for index, token in enumerate(tokens):
        if token.text == "{":
            stack.append(_opening(tokens, index))
        elif token.text == "}" and stack:
            stack.pop()
    return stack


def _opening(tokens: Sequence[Token], index: int) -> list[Token]:
    """Return `skill goto` for the brace behind it, and one word where only one stands there."""
    words = [token for token in tokens[max(0, index - 2) : index] if token.kind is Kind.NAME]
    named = len(words) == 2 and words[0].text in {*MEMBERS, "skillset"}
    return words if named else words[-1:]


def _effect_names(tokens: Sequence[Token], skill: str | None) -> Iterator[str]:
    """Yield the effects that a skill names, by its words alone: the skill may be one that can't be read."""
    begin = next((i for i, t in enumerate(tokens) if t.text == "skill" and tokens[i + 1 : i + 2] and tokens[i + 1].text == skill), None)
    if begin is None:
        return
    depth = 0
    for index in range(begin, len(tokens) - 1):
        token, following = tokens[index], tokens[index + 1]
        depth += {"{": 1, "}": -1}.get(token.text, 0)
        if index > begin + 2 and (depth == 0 or (token.text == "skill" and tokens[min(index + 2, len(tokens) - 1)].text == "{")):
            return
        if token.text == "effect" and depth == 1:
            yield from _entries(tokens, index + 1) if following.text == "{" else _one_entry(tokens, index + 1)


def _entries(tokens: Sequence[Token], opening: int) -> Iterator[str]:
    """Yield the names of `{ name: r -> S  name { ... } }`."""
    depth = 0
    for index in range(opening, len(tokens) - 1):
        depth += {"{": 1, "}": -1}.get(tokens[index].text, 0)
        if depth == 0:
            return
        if depth == 1 and tokens[index].kind is Kind.NAME and tokens[index + 1].text in {":", "{"}:
            yield tokens[index].text


def _one_entry(tokens: Sequence[Token], index: int) -> Iterator[str]:
    if tokens[index].kind is Kind.NAME and index + 1 < len(tokens) and tokens[index + 1].text in {":", "{"}:
        yield tokens[index].text
