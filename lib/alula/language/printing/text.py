"""What both notations print alike: skillsets, resources, data, events, properties, changes and the atoms of conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from alula.language.syntax.resources import every_transition, is_of_silence, occurring
from alula.model.condition_text import bare_text
from alula.model.expressions import TRUE, Expression
from alula.model.model import NO_EFFECT, Data, Effect, Event, Hold, Parameter, Property, PropertyKind, Resource, Role, Skill, Skillset
from alula.model.units import UNIT_IN_SI

ConditionText = Callable[[Expression], str]


@dataclass(frozen=True)
class Style:
    """How a notation prints what it has of its own; ``types_outside`` where types stand before the only skillset of a file."""

    skill_lines: Callable[[Skill], Iterable[str]]
    condition: ConditionText
    transitions_in_block: bool
    types_outside: bool


def skillset_text(skillset: Skillset, style: Style, *, with_types: bool) -> str:
    """Return `skillset name { ... }` and a line end."""
    blocks = [
        [f"use {name}" for name in skillset.uses],
        [f"type {name}" for name in skillset.types] if with_types else [],
        [f"parameter {parameter_text(parameter)}" for parameter in skillset.parameters],
        [_data(data) for data in skillset.data],
        *(list(_resource(resource, in_block=style.transitions_in_block)) for resource in skillset.resources),
        *(list(_event(event, style.condition)) for event in skillset.events),
        *(list(style.skill_lines(skill)) for skill in skillset.skills),
        [_property(prop) for prop in skillset.properties],
    ]
    body = "\n\n".join("\n".join(f"  {line}" for line in block) for block in blocks if block)
    return f"skillset {skillset.name} {{\n{body}\n}}\n" if body else f"skillset {skillset.name} {{}}\n"


def block(word: str, entries: Iterable[str]) -> Iterator[str]:
    """Yield `word { entries }`, nothing when there are none."""
    lines = list(entries)
    if lines:
        yield f"  {word} {{"
        yield from (f"    {line}" for line in lines)
        yield "  }"


def parameter_text(parameter: Parameter) -> str:
    """Return `name: Type = default // comment`."""
    default = f" = {parameter.default}" if parameter.default else ""
    return f"{parameter.name}: {parameter.type}{default}{comment_text(parameter.comment)}"


def comment_text(comment: str) -> str:
    """Return the comment behind an entry."""
    return f" // {' '.join(comment.split())}" if comment else ""


def changes_text(effect: Effect) -> str:
    """Return `{ a -> S  b -> T }`."""
    changes = [f"{change.resource} -> {change.target}" for change in effect.assignments]
    return f"{{ {'  '.join(changes)} }}" if changes else "{}"


def effect_text(effect: Effect) -> str:
    """Return the definition of a named effect."""
    if len(effect.assignments) == 1:
        return f"{effect.name}: {effect.assignments[0].resource} -> {effect.assignments[0].target}"
    return f"{effect.name} {changes_text(effect)}"


def hold_text(hold: Hold | None) -> str:
    """Return ` for 2.0 s recovers at 12.0 V`; a unit that is not known stands in parentheses, so that it is taken for one."""
    if hold is None:
        return ""
    spoken = repr(hold.for_s) != "0.0" or hold.hysteresis is None
    parts = [f"for {hold.for_s!r} s"] if spoken else []
    if hold.hysteresis is not None:
        value = f"{hold.hysteresis!r} {hold.unit}".strip()
        parts.append(f"recovers at {value if hold.unit in UNIT_IN_SI else f'({value})'}")
    return f" {' '.join(parts)}"


def purpose_lines(skill: Skill, condition: ConditionText) -> Iterator[str]:
    """Yield the lines that say what a skill is for."""
    yield from _roles("provides", skill.provides)
    yield from _roles("needs", skill.needs)
    if skill.achieves != TRUE:
        yield f"  achieves {condition(skill.achieves)}"


def _roles(word: str, roles: Sequence[Role]) -> Iterator[str]:
    if len(roles) == 1:
        yield f"  {word} {roles[0].name}"
    elif roles:
        yield f"  {word} {{ {' '.join(one.name for one in roles)} }}"


# --- elements --------------------------------------------------------------------------------------------------------


def _data(data: Data) -> str:
    period = "" if data.period_s is None else f" period = {data.period_s!r}"
    return f"data {data.name}: {data.type}{period}{comment_text(data.unit)}"


def _resource(resource: Resource, *, in_block: bool) -> Iterator[str]:
    yield f"resource {resource.name} {{"
    silence = resource.silence_s is not None
    listed = tuple(transition for transition in resource.transitions if not (silence and is_of_silence(transition, resource.initial)))
    if resource.all_transitions:
        # Only the transitions that `transition all` would not give at that place need saying.
        every = every_transition(resource.states)
        rest = tuple(transition for transition in listed if transition.extern)
        listed = rest if rest + every == listed else listed
    if in_block or occurring(resource.initial, listed) != resource.states:
        yield f"  state {{ {' '.join(resource.states)} }}"
    if resource.initial:
        yield f"  initial {resource.initial}"
    if silence:
        yield f"  silence = {resource.silence_s!r}"
    transitions = [f"{'extern ' if transition.extern else ''}{transition.source} -> {transition.target}" for transition in listed]
    yield from block("transition", transitions) if in_block else (f"  {transition}" for transition in transitions)
    if resource.all_transitions:
        yield "  transition all"
    yield "}"


def _event(event: Event, condition: ConditionText) -> Iterator[str]:
    yield f"event {event.name} {{"
    if event.guard != TRUE:
        yield f"  guard {condition(event.guard)}"
    if event.effect != NO_EFFECT:
        yield f"  effect {changes_text(event.effect)}"
    yield "}"


def _property(prop: Property) -> str:
    condition = f"({bare_text(prop.condition)})"
    if prop.kind is PropertyKind.LEADS_TO and prop.consequence is not None:
        said = f"{condition} leads to ({bare_text(prop.consequence)})"
    else:
        said = f"{prop.kind.value} {condition}"
    return f"property {prop.name}: {said}{' assuming termination' if prop.fair else ''}"
