"""What an editor asks about a name: what it stands for, where it is defined, where else it stands, and under which other name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from alula.editor.occurrences import Entity, Occurrence, at, occurrences
from alula.language.lexer import MAX_CHARACTERS
from alula.language.models import ModelFile
from alula.language.syntax.cursor import OPERATOR_WORDS
from alula.model.model import Data, Effect, Parameter, Resource, Skill, Skillset, Transition
from alula.model.span import Span

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class RenameError(Exception):
    """A name can't be changed so; the message says why."""


@dataclass(frozen=True)
class Symbol:
    """An element of a file for an outline; ``kind`` as in ``Entity``."""

    name: str
    kind: str
    span: Span
    detail: str = ""
    children: tuple[Symbol, ...] = ()


def occurrence_at(file: ModelFile, line: int, column: int) -> Occurrence | None:
    """Return the name at a place, 1-based, if there is one that leads somewhere."""
    return at(file, line, column)


def references(file: ModelFile, entity: Entity) -> list[Occurrence]:
    """Return all places of what a name stands for."""
    return [one for one in occurrences(file) if one.entity == entity]


def definition(file: ModelFile, entity: Entity) -> Span | None:
    """Return where it is defined; a state where its resource names it first."""
    return next((one.span for one in references(file, entity) if one.defining), None)


SHARED = frozenset({"type", "skillset", "role"})
"""What other files of a robot know by its name; everything else belongs to one skillset."""


def renamed(files: Sequence[ModelFile], entity: Entity, name: str) -> dict[str, list[Span]]:
    """Return the places that a new name has to be put in, by file; raise RenameError where that can't be or would change the meaning.

    ``files``: the file that was asked about, and for what is ``SHARED`` all other models of the robot, read together.
    """
    if not NAME.fullmatch(name) or name in OPERATOR_WORDS or len(name) > MAX_CHARACTERS:
        raise RenameError(f"`{name[:40]}` is no name: names are made of a-z, A-Z, 0-9 and _, and are not and, or, not, true, false")
    found = {file.path: occurrences(file) for file in files}
    for file in files:
        if file.damaged:
            raise RenameError(f"{Path(file.path).name} has errors of syntax: what could not be read may have the name, too")
        if any(one.entity.name == name and one.entity.owner == entity.owner for one in found[file.path]):
            raise RenameError(f"`{name}` is there already")
    places = {path: [one.span for one in several if one.entity == entity] for path, several in found.items()}
    return {path: spans for path, spans in places.items() if spans}


def symbols(file: ModelFile) -> list[Symbol]:
    """Return the outline of a file."""
    return [_outline(skillset) for skillset in file.skillsets]


def _outline(skillset: Skillset) -> Symbol:
    parts = [Symbol(one.name, "data", one.span, one.type) for one in skillset.data]
    parts += [Symbol(one.name, "resource", one.span, " ".join(one.states)[:80]) for one in skillset.resources]
    parts += [Symbol(one.name, "event", one.span) for one in skillset.events]
    for skill in skillset.skills:
        inside = [Symbol(one.name, "input", one.span, one.type) for one in skill.inputs]
        inside += [Symbol(one.name, "invariant", one.span) for one in skill.invariants]
        inside += [Symbol(one.name, "result", one.span, one.kind.value) for one in skill.results]
        parts.append(Symbol(skill.name, "skill", skill.span, children=tuple(inside)))
    parts += [Symbol(one.name, "property", one.span, one.kind.value) for one in skillset.properties]
    return Symbol(skillset.name, "skillset", skillset.span, children=tuple(parts))


def description(file: ModelFile, entity: Entity) -> str:
    """Return a resource with its states and transitions, a skill with its parameters and results, a role's skills, another's definition."""
    if entity.kind == "role":
        return _role(file, entity.name)
    skillset = next((one for one in file.skillsets if entity.owner and one.name == entity.owner[0]), None)
    if skillset is None:
        return ""
    match entity.kind:
        case "resource" if entity.name in skillset.resource_index:
            return _resource(skillset.resource_index[entity.name])
        case "state" if entity.owner[1] in skillset.resource_index:
            return _state(skillset.resource_index[entity.owner[1]], entity.name)
        case "skill" if entity.name in skillset.skill_index:
            return _skill(skillset.skill_index[entity.name])
        case "data" if entity.name in skillset.data_index:
            return _data(skillset.data_index[entity.name])
        case "effect" | "input" | "output" | "parameter":
            return _of_skill(skillset.skill_index.get(entity.owner[1]), entity)
        case _:
            return ""


def _role(file: ModelFile, name: str) -> str:
    skills = [one for skillset in file.skillsets for one in skillset.skills]
    provided = ", ".join(one.name for one in skills if any(role.name == name for role in one.provides))
    needed = ", ".join(one.name for one in skills if any(role.name == name for role in one.needs))
    lines = (f"  provided by {provided}" if provided else "", f"  needed by {needed}" if needed else "")
    return "\n".join([f"role {name}", *(line for line in lines if line)])


def _of_skill(skill: Skill | None, entity: Entity) -> str:
    if skill is None:
        return ""
    several: dict[str, tuple[Effect | Parameter, ...]] = {
        "effect": skill.effects,
        "input": skill.inputs,
        "output": skill.outputs,
        "parameter": skill.parameters,
    }
    found = next((one for one in several[entity.kind] if one.name == entity.name), None)
    if isinstance(found, Effect):
        return f"effect {found.name} {{ {'  '.join(f'{c.resource} -> {c.target}' for c in found.assignments)} }}"
    return "" if found is None else f"{found.name}: {found.type}" + (f" // {found.comment}" if found.comment else "")


def _data(data: Data) -> str:
    return f"data {data.name}: {data.type}" + (f" period {data.period_s:g} s" if data.period_s is not None else "")


def _resource(resource: Resource) -> str:
    lines = [f"resource {resource.name} {{", f"  state {{ {' '.join(resource.states)} }}", f"  initial {resource.initial}"]
    if resource.all_transitions:
        lines.append("  transition all")
    transitions = [transition for transition in resource.transitions if transition.extern or not resource.all_transitions]
    return "\n".join([*lines, *(f"  {_transition(transition)}" for transition in transitions), "}"])


def _state(resource: Resource, state: str) -> str:
    transitions = [
        transition
        for transition in resource.transitions
        if state in {transition.source, transition.target} and transition.source != transition.target
    ]
    return "\n".join([f"{resource.name} == {state}", *(f"  {_transition(transition)}" for transition in transitions)])


def _transition(transition: Transition) -> str:
    return f"{'extern ' if transition.extern else ''}{transition.source} -> {transition.target}"


def _skill(skill: Skill) -> str:
    inputs = ", ".join(f"{p.name}: {p.type}" for p in skill.inputs)
    outputs = ", ".join(f"{p.name}: {p.type}" for p in skill.outputs)
    lines = [f"skill {skill.name}({inputs})" + (f" -> ({outputs})" if outputs else "")]
    lines += [f"  {result.kind.value} {result.name}" for result in skill.results]
    return "\n".join(lines)
