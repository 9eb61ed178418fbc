"""What is wrong with a model that reads well: names that lead nowhere, effects that no arrow allows, periods, duplicates.

These are the findings that need no search through the model's executions.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Protocol

from skill_language import ros_types
from skill_language.errors import Diagnostic, Severity, nearest, quoted
from skill_language.model import (
    NO_EFFECT,
    Comparison,
    Data,
    DataIs,
    Effect,
    Expression,
    Parameter,
    Resource,
    ResourceIs,
    Skill,
    Skillset,
    Span,
    atoms,
)


class _Named(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def span(self) -> Span: ...


def check(skillset: Skillset) -> list[Diagnostic]:
    """Return all findings about a skillset in the order of the source."""
    findings = [finding for rule in RULES for finding in rule(skillset)]
    for skill in skillset.skills:
        findings += [finding for skill_rule in SKILL_RULES for finding in skill_rule(skillset, skill)]
    unique = dict.fromkeys(findings)
    return sorted(unique, key=lambda d: (d.span.line, d.span.column, d.code))


# --- skillset --------------------------------------------------------------------------------------------------------


def _skillset_names(skillset: Skillset) -> Iterator[Diagnostic]:
    yield from _duplicates("resource", skillset.resources)
    yield from _duplicates("data", skillset.data)
    yield from _duplicates("skill", skillset.skills)
    yield from _duplicates("event", skillset.events)
    yield from _duplicates("parameter", skillset.parameters)
    for index, name in enumerate(skillset.types):
        if name in skillset.types[:index]:
            yield _error("ALU201", f"type `{name}` is declared twice", skillset.span)
    yield from _one_in_code("skill", skillset.skills, ros_types.camel)
    if not ros_types.is_package_name(skillset.name):
        hint = "a ROS name has a-z, 0-9 and single _, and begins with a letter"
        yield _error("ALU216", f"`{skillset.name}` can't be the name of a ROS package", skillset.span, hint=hint)
    for data in skillset.data:
        yield from _ros_name("data", data)


def _resources(skillset: Skillset) -> Iterator[Diagnostic]:
    for resource in skillset.resources:
        yield from _states(resource)
        yield from _initial(resource)
        yield from _reach(resource)


def _states(resource: Resource) -> Iterator[Diagnostic]:
    for index, state in enumerate(resource.states):
        if state in resource.states[:index]:
            yield _error("ALU201", f"state `{state}` of `{resource.name}` is listed twice", resource.span)
    seen: set[tuple[str, str, bool]] = set()
    for arrow in resource.transitions:
        for state in dict.fromkeys((arrow.source, arrow.target)):
            if state not in resource.states:
                yield _unknown_state(resource, state, arrow.span)
        key = (arrow.source, arrow.target, arrow.extern)
        if key in seen:
            yield _error("ALU201", f"the arrow `{arrow.source} -> {arrow.target}` of `{resource.name}` is given twice", arrow.span)
        seen.add(key)


def _initial(resource: Resource) -> Iterator[Diagnostic]:
    ends = {state for arrow in resource.transitions for state in (arrow.source, arrow.target)}
    if not resource.initial:
        hint = f"add `initial {resource.states[0]}`" if resource.states else "add `initial STATE`"
        yield _error("ALU207", f"resource `{resource.name}` has no initial state", resource.span, hint=hint)
    elif resource.initial not in resource.states or (ends and resource.initial not in ends):
        message = f"the initial state `{resource.initial}` of `{resource.name}` has no arrow"
        yield _error("ALU208", message, resource.span, hint=nearest(resource.initial, ends))


def _reach(resource: Resource) -> Iterator[Diagnostic]:
    if not resource.initial or resource.initial not in resource.states:
        return
    reached, todo = {resource.initial}, [resource.initial]
    while todo:
        source = todo.pop()
        following = {arrow.target for arrow in resource.transitions if arrow.source == source} - reached
        reached |= following
        todo += following
    for state in resource.states:
        if state not in reached:
            message = f"state `{state}` of `{resource.name}` can't be reached from `{resource.initial}`"
            yield _warning("ALU302", message, resource.span)


def _types(skillset: Skillset) -> Iterator[Diagnostic]:
    used: set[str] = set()
    typed: list[Data | Parameter] = [*skillset.data, *skillset.parameters]
    for skill in skillset.skills:
        typed += [*skill.inputs, *skill.outputs, *skill.parameters]
    for element in typed:
        used.add(element.type)
        if element.type not in skillset.types and element.type not in ros_types.PRIMITIVES:
            hint = nearest(element.type, [*skillset.types, *ros_types.PRIMITIVES])
            hint = hint if hint.startswith("did") else f"declare it with `type {element.type}`"
            yield _error("ALU205", f"unknown type `{element.type}`", element.span, hint=hint)
    for name in skillset.types:
        if name not in used:
            yield _warning("ALU303", f"type `{name}` is never used", skillset.span)


def _periods(skillset: Skillset) -> Iterator[Diagnostic]:
    for data in skillset.data:
        if data.period_s is not None and data.period_s <= 0:
            yield _error("ALU211", f"the period of data `{data.name}` is {data.period_s:g} s; it must be positive", data.span)
    for skill in skillset.skills:
        progress = skill.progress
        if progress and progress.period_s <= 0:
            message = f"the progress period of `{skill.name}` is {progress.period_s:g} s; it must be positive"
            yield _error("ALU211", message, progress.span)


def _events(skillset: Skillset) -> Iterator[Diagnostic]:
    for event in skillset.events:
        yield from _condition(skillset, event.guard, f"the guard of `{event.name}`", data_allowed=False)
        # What happens by itself may take any arrow: it speaks for the functional layer.
        yield from _effect(skillset, event.effect, any_arrow=True)


RULES: Sequence[Callable[[Skillset], Iterable[Diagnostic]]] = (_skillset_names, _resources, _types, _periods, _events)


# --- skills ----------------------------------------------------------------------------------------------------------


def _skill_names(skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    yield from _duplicates("effect", skill.effects)
    yield from _duplicates("precondition", skill.preconditions)
    yield from _duplicates("invariant", skill.invariants)
    yield from _duplicates("result", skill.results)
    yield from _duplicates("input", skill.inputs)
    yield from _duplicates("output", skill.outputs)
    shared = {resource.name: "resource" for resource in skillset.resources} | {data.name: "data" for data in skillset.data}
    for parameter in (*skill.inputs, *skill.outputs):
        if parameter.name in shared:
            message = f"`{parameter.name}` of `{skill.name}` has the name of a {shared[parameter.name]}, and hides it from no condition"
            yield _warning("ALU304", message, parameter.span, hint="conditions speak of resources and data, never of inputs")
    for output in skill.outputs:
        if any(output.name == given.name for given in skill.inputs):
            yield _error("ALU201", f"`{output.name}` is an input and an output of `{skill.name}`", output.span)


def _interface_names(_skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    if skill.name in CLIENT_NAMES or keyword.iskeyword(skill.name):
        yield _error("ALU215", f"the generated client needs the name `{skill.name}` for itself; name the skill otherwise", skill.span)
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", skill.name):
        hint = "a skill's name begins with a letter, and has single _ between letters and digits"
        yield _error("ALU216", f"skill `{skill.name}` can't be the name of a ROS action", skill.span, hint=hint)
    for parameter in (*skill.inputs, *skill.outputs):
        yield from _ros_name("field", parameter)
    for output in skill.outputs:
        if output.name in RESULT_FIELDS:
            message = f"the generated action needs the field `{output.name}` for itself; name the output otherwise"
            yield _error("ALU215", message, output.span)
    for given in skill.inputs:
        if given.name in INPUT_NAMES:
            yield _error("ALU215", f"generated code needs the name `{given.name}` for itself; name the input otherwise", given.span)


def _conditions(skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    for precondition in skill.preconditions:
        yield from _condition(skillset, precondition.condition, f"precondition `{precondition.name}`", data_allowed=True)
    for invariant in skill.invariants:
        yield from _condition(skillset, invariant.condition, f"invariant `{invariant.name}`", data_allowed=False)
    yield from _condition(skillset, skill.interrupt.postcondition, "the interruption's postcondition", data_allowed=False)
    for result in skill.results:
        yield from _condition(skillset, result.postcondition, f"the postcondition of `{result.name}`", data_allowed=False)


def _effects(skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    used = _used_effects(skill)
    defined = {effect.name for effect in skill.effects}
    for effect in (*skill.effects, *(e for e in used if e.name not in defined)):
        yield from _effect(skillset, effect, any_arrow=False)
    names = {effect.name for effect in used}
    for effect in skill.effects:
        if effect.name not in names:
            yield _warning("ALU301", f"effect `{effect.name}` of `{skill.name}` is never used", effect.span)


def _ends(_skillset: Skillset, skill: Skill) -> Iterator[Diagnostic]:
    if not skill.results:
        hint = "add a `result { ... }` block with at least one result"
        yield _error("ALU218", f"skill `{skill.name}` has no result", skill.span, hint=hint)


SKILL_RULES: Sequence[Callable[[Skillset, Skill], Iterable[Diagnostic]]] = (
    _skill_names,
    _interface_names,
    _conditions,
    _effects,
    _ends,
)

RESULT_FIELDS = frozenset({"outcome", "result", "message", "progress"})
"""Fields of the generated action's result and feedback that every skill has."""

INPUT_NAMES = frozenset({"self", "skill"})
"""Names that the client's methods have already."""

CLIENT_NAMES = frozenset({"start", "resources", "wait_ready", "on_change", "node", "describe", "model", "skillset", "close", "get_data"})
"""Attributes of the generic client that a method named like a skill would hide."""


# --- parts -----------------------------------------------------------------------------------------------------------


def _used_effects(skill: Skill) -> list[Effect]:
    used = [skill.start, skill.interrupt.effect]
    used += [invariant.effect for invariant in skill.invariants]
    used += [result.effect for result in skill.results]
    return [effect for effect in used if effect != NO_EFFECT]


def _condition(skillset: Skillset, condition: Expression, where: str, *, data_allowed: bool) -> Iterator[Diagnostic]:
    resources = {resource.name: resource for resource in skillset.resources}
    for atom in atoms(condition):
        if isinstance(atom, ResourceIs):
            if atom.resource not in resources:
                yield _unknown_resource(skillset, atom.resource, atom.span)
            elif atom.state not in resources[atom.resource].states:
                yield _unknown_state(resources[atom.resource], atom.state, atom.span)
        elif isinstance(atom, DataIs):
            if not data_allowed:
                hint = "let the functional layer report it as a state of a resource"
                yield _error("ALU213", f"{where} asks data `{atom.data}`; only preconditions may", atom.span, hint=hint)
            yield from _data(skillset, atom)


def _data(skillset: Skillset, atom: DataIs) -> Iterator[Diagnostic]:
    types = {data.name: data.type for data in skillset.data}
    if atom.data not in types:
        message = f"skillset `{skillset.name}` has no data `{atom.data}`"
        yield _error("ALU206", message, atom.span, hint=nearest(atom.data, types))
        return
    if isinstance(atom.value, bool | str) and atom.comparison not in {Comparison.EQ, Comparison.NE}:
        kind = "a truth value" if isinstance(atom.value, bool) else "a text"
        yield _error("ALU214", f"`{atom.comparison.value}` doesn't compare {kind}; use == or !=", atom.span)
    python = ros_types.PRIMITIVES.get(types[atom.data])
    if python is None:
        return
    if atom.path:
        message = f"data `{atom.data}` is a {types[atom.data]} and has no field `{'.'.join(atom.path)}`"
        yield _error("ALU214", message, atom.span)
    elif (python in {"int", "float"}) != isinstance(atom.value, float) or (python == "str") != isinstance(atom.value, str):
        yield _error("ALU214", f"data `{atom.data}` is a {types[atom.data]} and can't be compared with {atom.value!r}", atom.span)


def _effect(skillset: Skillset, effect: Effect, *, any_arrow: bool) -> Iterator[Diagnostic]:
    resources = {resource.name: resource for resource in skillset.resources}
    seen: set[str] = set()
    for change in effect.assignments:
        if change.resource in seen:
            yield _error("ALU212", f"effect `{effect.name}` sets `{change.resource}` twice", change.span)
        seen.add(change.resource)
        resource = resources.get(change.resource)
        if resource is None:
            yield _unknown_resource(skillset, change.resource, change.span)
        elif change.target not in resource.states:
            yield _unknown_state(resource, change.target, change.span)
        else:
            yield from _arrow(effect, resource, change.target, change.span, any_arrow=any_arrow)


def _arrow(effect: Effect, resource: Resource, target: str, span: Span, *, any_arrow: bool) -> Iterator[Diagnostic]:
    arrows = [arrow for arrow in resource.transitions if arrow.target == target]
    if any(any_arrow or not arrow.extern for arrow in arrows):
        return
    name = f"effect `{effect.name}`" if effect.name else "the effect"
    if arrows:
        message = f"{name} would take `{resource.name}` to `{target}`, but only the functional layer may (every arrow there is extern)"
        hint = f"add an arrow without `extern` to resource `{resource.name}` if skills are to take it"
        yield _error("ALU210", message, span, hint=hint)
        return
    targets = dict.fromkeys(arrow.target for arrow in resource.transitions if not arrow.extern)
    hint = f"skills can take it to {quoted(list(targets))}" if targets else f"add `STATE -> {target}` to resource `{resource.name}`"
    yield _error("ALU209", f"{name} would take `{resource.name}` to `{target}`, but no arrow leads there", span, hint=hint)


def _unknown_resource(skillset: Skillset, name: str, span: Span) -> Diagnostic:
    known = [resource.name for resource in skillset.resources]
    return _error("ALU202", f"skillset `{skillset.name}` has no resource `{name}`", span, hint=nearest(name, known))


def _unknown_state(resource: Resource, state: str, span: Span) -> Diagnostic:
    return _error("ALU203", f"resource `{resource.name}` has no state `{state}`", span, hint=nearest(state, resource.states))


def _duplicates(what: str, elements: Sequence[_Named]) -> Iterator[Diagnostic]:
    first: dict[str, _Named] = {}
    for element in elements:
        if not element.name:
            continue
        if element.name in first:
            at = first[element.name].span
            hint = f"it is defined in line {at.line} first" if at.line else ""
            yield _error("ALU201", f"{what} `{element.name}` is defined twice", element.span, hint=hint)
        first.setdefault(element.name, element)


def _one_in_code(what: str, elements: Sequence[_Named], code_name: Callable[[str], str]) -> Iterator[Diagnostic]:
    first: dict[str, str] = {}
    for element in elements:
        other = first.setdefault(code_name(element.name), element.name)
        if other != element.name:
            message = f"{what}s `{other}` and `{element.name}` are both `{code_name(element.name)}` in generated code"
            yield _error("ALU217", message, element.span)


def _ros_name(what: str, element: _Named) -> Iterator[Diagnostic]:
    if not ros_types.is_field_name(element.name):
        hint = "ROS wants a-z, 0-9 and single _, a letter first, no word of Python"
        yield _error("ALU216", f"`{element.name}` can't be the name of a ROS {what}", element.span, hint=hint)


def _error(code: str, message: str, span: Span, *, hint: str = "") -> Diagnostic:
    return Diagnostic(code, message, span, hint=hint)


def _warning(code: str, message: str, span: Span, *, hint: str = "") -> Diagnostic:
    return Diagnostic(code, message, span, Severity.WARNING, hint)
