"""What rules share: whether conditions and effects lead somewhere, whether names are free, and how a finding is made."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Protocol

from alula.common.suggestions import nearest, quoted
from alula.language.errors import Diagnostic, Severity
from alula.model import ros_types
from alula.model.expressions import Comparison, DataIs, Expression, ResourceIs, SkillRuns, atoms
from alula.model.model import Effect, Resource, Skillset
from alula.model.span import Span
from alula.model.units import UNIT_IN_SI


class Named(Protocol):
    """An element of the model with a name and a place."""

    @property
    def name(self) -> str:
        """The name in the model."""
        ...

    @property
    def span(self) -> Span:
        """The place of the definition in its file."""
        ...


def condition_findings(
    skillset: Skillset, condition: Expression, where: str, *, data_allowed: bool, executions_allowed: bool = False
) -> Iterator[Diagnostic]:
    """Yield what is wrong with the resources, states, data and skills in a condition; ``where`` names the condition in messages."""
    resources = skillset.resource_index
    for atom in atoms(condition):
        if isinstance(atom, ResourceIs):
            yield from _resource_atom(skillset, resources, atom)
        elif isinstance(atom, DataIs):
            if not data_allowed:
                hint = "let the functional layer report it as a state of a resource"
                yield error("ALU213", f"{where} asks data `{atom.data}`; only preconditions and invariants may", atom.span, hint=hint)
            yield from _data(skillset, atom)
        elif isinstance(atom, SkillRuns):
            if not executions_allowed:
                hint = "ask a resource that the skill takes at its start"
                yield error("ALU223", f"{where} asks whether `{atom.skill}` runs; only properties may", atom.span, hint=hint)
            known = [skill.name for skill in skillset.skills]
            if atom.skill not in known:
                message = f"skillset `{skillset.name}` has no skill `{atom.skill}`"
                yield error("ALU222", message, atom.span, hint=nearest(atom.skill, known))


def _resource_atom(skillset: Skillset, resources: Mapping[str, Resource], atom: ResourceIs) -> Iterator[Diagnostic]:
    if atom.resource in resources:
        if atom.state not in resources[atom.resource].states:
            yield unknown_state(resources[atom.resource], atom.state, last_word(atom.span, atom.state))
    elif atom.resource in skillset.data_index:
        message = f"skillset `{skillset.name}` has no resource `{atom.resource}`, it is data"
        hint = f'data is compared with a number, true, false or a text: `{atom.resource} == "{atom.state}"`'
        yield error("ALU202", message, atom.span, hint=hint)
    else:
        yield _unknown_resource(skillset, atom.resource, first_word(atom.span, atom.resource))


def _data(skillset: Skillset, atom: DataIs) -> Iterator[Diagnostic]:
    data = skillset.data_index.get(atom.data)
    if data is None:
        message = f"skillset `{skillset.name}` has no data `{atom.data}`"
        yield error("ALU206", message, atom.span, hint=nearest(atom.data, skillset.data_index))
        return
    if isinstance(atom.value, bool | str) and atom.comparison not in {Comparison.EQ, Comparison.NE}:
        kind = "a truth value" if isinstance(atom.value, bool) else "a text"
        yield error("ALU214", f"`{atom.comparison.value}` doesn't compare {kind}; use == or !=", atom.span)
    yield from unit_findings(atom.unit, last_word(atom.span, atom.unit))
    python = ros_types.PRIMITIVES.get(data.type)
    if python is None:
        return
    if atom.path:
        message = f"data `{atom.data}` is a {data.type} and has no field `{'.'.join(atom.path)}`"
        yield error("ALU214", message, atom.span)
    elif (python in {"int", "float"}) != isinstance(atom.value, float) or (python == "str") != isinstance(atom.value, str):
        yield error("ALU214", f"data `{atom.data}` is a {data.type} and can't be compared with {atom.value!r}", atom.span)


def unit_findings(unit: str, span: Span) -> Iterator[Diagnostic]:
    """Yield a finding when a unit is not known."""
    if unit not in UNIT_IN_SI:
        hint = nearest(unit, UNIT_IN_SI) or f"there are {quoted([known for known in UNIT_IN_SI if known])}"
        yield error("ALU219", f"unknown unit `{unit}`", span, hint=hint)


def effect_findings(skillset: Skillset, effect: Effect, *, any_transition: bool) -> Iterator[Diagnostic]:
    """Yield what is wrong with an effect; with ``any_transition`` it may take extern transitions, too."""
    resources = skillset.resource_index
    seen: set[str] = set()
    for change in effect.assignments:
        if change.resource in seen:
            yield warning("ALU212", f"{_called(effect)} sets `{change.resource}` twice", change.span, hint="one change follows the other")
        seen.add(change.resource)
        resource = resources.get(change.resource)
        if resource is None:
            yield _unknown_resource(skillset, change.resource, first_word(change.span, change.resource))
        elif change.target not in resource.states:
            yield unknown_state(resource, change.target, last_word(change.span, change.target))
        else:
            yield from _transition(effect, resource, change.target, change.span, any_transition=any_transition)


def _transition(effect: Effect, resource: Resource, target: str, span: Span, *, any_transition: bool) -> Iterator[Diagnostic]:
    transitions = [transition for transition in resource.transitions if transition.target == target]
    if any(any_transition or not transition.extern for transition in transitions):
        return
    name = _called(effect)
    if transitions:
        message = f"{name} would take `{resource.name}` to `{target}`, but only the functional layer may (every transition there is extern)"
        hint = f"add a transition without `extern` to resource `{resource.name}` if skills are to take it"
        yield error("ALU210", message, span, hint=hint)
        return
    targets = dict.fromkeys(transition.target for transition in resource.transitions if not transition.extern)
    hint = f"skills can take it to {quoted(list(targets))}" if targets else f"add `STATE -> {target}` to resource `{resource.name}`"
    # A resource in the initial state may stay there, though the effect then never does anything.
    tell = warning if target == resource.initial else error
    yield tell("ALU209", f"{_called(effect)} would take `{resource.name}` to `{target}`, but no transition leads there", span, hint=hint)


def _called(effect: Effect) -> str:
    return f"effect `{effect.name}`" if effect.name else "the effect"


def _unknown_resource(skillset: Skillset, name: str, span: Span) -> Diagnostic:
    known = [resource.name for resource in skillset.resources]
    return error("ALU202", f"skillset `{skillset.name}` has no resource `{name}`", span, hint=nearest(name, known))


def unknown_state(resource: Resource, state: str, span: Span) -> Diagnostic:
    """Return the finding that a resource has no such state."""
    return error("ALU203", f"resource `{resource.name}` has no state `{state}`", span, hint=nearest(state, resource.states))


def first_word(span: Span, word: str) -> Span:
    """Return the place of the word that a place begins with."""
    return replace(span, end_column=min(span.end_column, span.column + len(word)))


def last_word(span: Span, word: str) -> Span:
    """Return the place of the word that a place ends with."""
    return replace(span, column=max(span.column, span.end_column - len(word)))


def duplicates(what: str, elements: Sequence[Named]) -> Iterator[Diagnostic]:
    """Yield a finding for every element that has the name of an earlier one."""
    first: dict[str, Named] = {}
    for element in elements:
        if not element.name:
            continue
        if element.name in first:
            at = first[element.name].span
            hint = f"it is defined in line {at.line} first" if at.line else ""
            yield error("ALU201", f"{what} `{element.name}` is defined twice", element.span, hint=hint)
        first.setdefault(element.name, element)


def names_of_types(skillset: Skillset, elements: Sequence[Named]) -> Iterator[Diagnostic]:
    """Yield a finding for every element that has the name of a type."""
    for element in elements:
        if element.name in skillset.types:
            yield error("ALU201", f"`{element.name}` is the name of a type", element.span, hint="name one of them otherwise")


def one_in_code(what: str, elements: Sequence[Named], code_name: Callable[[str], str]) -> Iterator[Diagnostic]:
    """Yield a finding for every element whose name becomes another one's in generated code."""
    first: dict[str, str] = {}
    for element in elements:
        other = first.setdefault(code_name(element.name), element.name)
        if other != element.name:
            message = f"{what}s `{other}` and `{element.name}` are both `{code_name(element.name)}` in generated code"
            yield for_generator("ALU217", message, element.span)


def ros_name(what: str, element: Named) -> Iterator[Diagnostic]:
    """Yield a finding when ROS does not allow an element's name for a field or topic."""
    if not ros_types.is_field_name(element.name):
        hint = "ROS allows a-z, 0-9 and single _, beginning with a letter; and it may be no keyword of Python"
        yield for_generator("ALU216", f"`{element.name}` can't be the name of a ROS {what}", element.span, hint=hint)


def error(code: str, message: str, span: Span, *, hint: str = "") -> Diagnostic:
    """Return a finding of severity ERROR: the model can't be used."""
    return Diagnostic(code, message, span, hint=hint)


def for_generator(code: str, message: str, span: Span, *, hint: str = "") -> Diagnostic:
    """Return a warning that is an error when code is to be generated (see ``load.load_robot``): the model itself is sound."""
    return Diagnostic(code, message, span, Severity.WARNING, hint, for_generator=True)


def warning(code: str, message: str, span: Span, *, hint: str = "") -> Diagnostic:
    """Return a finding of severity WARNING: the model can still be used."""
    return Diagnostic(code, message, span, Severity.WARNING, hint)
