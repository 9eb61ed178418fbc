"""From a model to the paper's notation: what is printed reads back as the same model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from skill_language.lexer import quote
from skill_language.model import (
    NO_EFFECT,
    TRUE,
    And,
    Constant,
    Data,
    DataIs,
    Effect,
    Expression,
    Implies,
    Interrupt,
    Not,
    Or,
    Parameter,
    Resource,
    ResourceIs,
    Result,
    ResultKind,
    Skill,
    Skillset,
    atoms,
)
from skill_language.paper.skillset import every_arrow, occurring


class NotInThisNotationError(ValueError):
    """The model uses something of the Robot Language that the paper's notation has no words for."""


def print_skillset(skillset: Skillset) -> str:
    """Return the skillset in the paper's notation; raise NotInThisNotationError naming what it can't say."""
    _refuse(skillset)
    blocks = [
        [f"type {name}" for name in skillset.types],
        [_data(data) for data in skillset.data],
        *(list(_resource(resource)) for resource in skillset.resources),
        *(list(_skill(skill)) for skill in skillset.skills),
    ]
    body = "\n\n".join("\n".join(f"  {line}" for line in block) for block in blocks if block)
    return f"skillset {skillset.name} {{\n{body}\n}}\n" if body else f"skillset {skillset.name} {{}}\n"


def print_condition(condition: Expression) -> str:
    """Return a condition as it stands behind `name:`."""
    kinds = {type(atom) for atom in atoms(condition)} - {Constant}
    if kinds == {ResourceIs}:
        return f"resource = ({_expression(condition, _IMPLIES)})"
    if kinds == {DataIs}:
        return f"data = ({_expression(condition, _IMPLIES)})"
    return _expression(condition, _IMPLIES, outside=True)


def _refuse(skillset: Skillset) -> None:
    """Raise for what only the other notation can say."""
    found = [f"event {event.name}" for event in skillset.events]
    found += [f"parameter {parameter.name}" for parameter in skillset.parameters]
    for skill in skillset.skills:
        found += [f"parameter {parameter.name} of {skill.name}" for parameter in skill.parameters]
        found += [f"{r.kind.value} {r.name} of {skill.name}" for r in skill.results if r.kind is not ResultKind.PLAIN]
        if skill.interrupt.interrupting:
            found.append(f"interrupting of {skill.name}")
        if skill.progress and skill.progress.message:
            found.append(f"the progress message of {skill.name}")
        used = [skill.start, skill.interrupt.effect, *(i.effect for i in skill.invariants), *(r.effect for r in skill.results)]
        defined = {effect.name: effect for effect in skill.effects}
        found += [f"an effect in place in {skill.name}" for e in used if e != NO_EFFECT and defined.get(e.name) != e]
    if found:
        raise NotInThisNotationError(f"the paper's notation has no words for: {', '.join(dict.fromkeys(found))}")


# --- elements --------------------------------------------------------------------------------------------------------


def _data(data: Data) -> str:
    period = "" if data.period_s is None else f" period = {data.period_s!r}"
    return f"data {data.name}: {data.type}{period}"


def _resource(resource: Resource) -> Iterator[str]:
    yield f"resource {resource.name} {{"
    listed = resource.transitions
    if resource.all_transitions:
        # Only the arrows that `transition all` would not give at that place need saying.
        every = every_arrow(resource.states)
        listed = () if listed == every else listed
    if occurring(resource.initial, listed) != resource.states:
        yield f"  state {{ {' '.join(resource.states)} }}"
    if resource.initial:
        yield f"  initial {resource.initial}"
    for arrow in listed:
        yield f"  {'extern ' if arrow.extern else ''}{arrow.source} -> {arrow.target}"
    if resource.all_transitions:
        yield "  transition all"
    yield "}"


def _skill(skill: Skill) -> Iterator[str]:
    yield f"skill {skill.name} {{"
    if skill.progress:
        yield f"  progress = {skill.progress.period_s!r}"
    yield from _block("input", (_parameter(p) for p in skill.inputs))
    yield from _block("output", (_parameter(p) for p in skill.outputs))
    yield from _block("effect", (_effect(e) for e in skill.effects))
    start = [f"success {skill.start.name}"] if skill.start != NO_EFFECT else []
    yield from _block("precondition", [f"{p.name}: {print_condition(p.condition)}" for p in skill.preconditions] + start)
    yield from _block("invariant", (f"{i.name}: {print_condition(i.condition)}{_violation(i.effect)}" for i in skill.invariants))
    if skill.interrupt != Interrupt():
        yield from _block("interrupt", [_outcome(skill.interrupt.effect, skill.interrupt.postcondition)])
    yield from _block("result", (_result(r) for r in skill.results))
    yield "}"


def _block(word: str, entries: Iterable[str]) -> Iterator[str]:
    lines = list(entries)
    if lines:
        yield f"  {word} {{"
        yield from (f"    {line}" for line in lines)
        yield "  }"


def _parameter(parameter: Parameter) -> str:
    return f"{parameter.name}: {parameter.type}{_comment(parameter.comment)}"


def _effect(effect: Effect) -> str:
    changes = [f"{change.resource} -> {change.target}" for change in effect.assignments]
    if len(changes) == 1:
        return f"{effect.name}: {changes[0]}"
    return f"{effect.name} {{ {'  '.join(changes)} }}" if changes else f"{effect.name} {{}}"


def _violation(effect: Effect) -> str:
    return "" if effect == NO_EFFECT else f" violation = {effect.name}"


def _outcome(effect: Effect, postcondition: Expression) -> str:
    parts = [] if effect == NO_EFFECT else [f"apply = {effect.name}"]
    if postcondition != TRUE:
        parts.append(f"post {print_condition(postcondition)}")
    return " ".join(parts)


def _result(result: Result) -> str:
    outcome = _outcome(result.effect, result.postcondition)
    return f"{result.name}{': ' if outcome else ''}{outcome}{_comment(result.comment)}"


def _comment(comment: str) -> str:
    return f" // {' '.join(comment.split())}" if comment else ""


# --- conditions ------------------------------------------------------------------------------------------------------

_IMPLIES, _OR, _AND, _NOT = range(4)


def _expression(condition: Expression, tightness: int, *, outside: bool = False) -> str:
    """Return a condition, in parentheses where an operator as tight as ``tightness`` around it would tear it apart."""
    match condition:
        case ResourceIs() | DataIs():
            return print_condition(condition) if outside else _atom(condition)
        case Constant(value=value):
            return "true" if value else "false"
        case Not(operand=operand):
            return f"not {_part(operand, _NOT, outside=outside)}"
        case And(operands=operands):
            level, text = _AND, " and ".join(_part(o, _NOT, outside=outside) for o in operands)
        case Or(operands=operands):
            level, text = _OR, " or ".join(_part(o, _AND, outside=outside) for o in operands)
        case Implies(premise=premise, conclusion=conclusion):
            level = _IMPLIES
            text = f"{_part(premise, _OR, outside=outside)} => {_part(conclusion, _IMPLIES, outside=outside)}"
    return f"({text})" if level < tightness else text


def _part(condition: Expression, tightness: int, *, outside: bool) -> str:
    """Return an operand; outside of `resource = (...)` the largest part about one kind gets its own."""
    kinds = {type(atom) for atom in atoms(condition)} - {Constant}
    if outside and len(kinds) == 1:
        return print_condition(condition)
    return _expression(condition, tightness, outside=outside)


def _atom(atom: ResourceIs | DataIs) -> str:
    if isinstance(atom, ResourceIs):
        return f"{atom.resource} {'!=' if atom.negated else '=='} {atom.state}"
    match atom.value:
        case bool():
            value = "true" if atom.value else "false"
        case str():
            value = quote(atom.value)
        case _:
            value = repr(float(atom.value))
    unit = f" {atom.unit}" if atom.unit else ""
    return f"{'.'.join((atom.data, *atom.path))} {atom.comparison.value} {value}{unit}"
