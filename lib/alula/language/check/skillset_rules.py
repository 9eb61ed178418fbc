"""Rules about a skillset as a whole: its names, resources, types and periods."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence

from alula.common.deployments import SHORTEST_SILENCE_S
from alula.common.suggestions import nearest
from alula.language.check.references import (
    Named,
    condition_findings,
    duplicates,
    effect_findings,
    error,
    first_word,
    for_generator,
    last_word,
    names_of_types,
    one_in_code,
    ros_name,
    unknown_state,
    warning,
)
from alula.language.check.units import unit_kinds
from alula.language.errors import Diagnostic
from alula.language.syntax.document import typed_elements
from alula.language.syntax.resources import occurring
from alula.model import ros_types
from alula.model.model import Resource, Skillset
from alula.model.span import Span


def _skillset_names(skillset: Skillset) -> Iterator[Diagnostic]:
    yield from duplicates("resource", skillset.resources)
    yield from duplicates("data", skillset.data)
    yield from duplicates("skill", skillset.skills)
    yield from duplicates("event", skillset.events)
    yield from duplicates("parameter", skillset.parameters)
    yield from duplicates("property", skillset.properties)
    named: tuple[Named, ...] = (*skillset.resources, *skillset.data, *skillset.skills, *skillset.events, *skillset.parameters)
    yield from names_of_types(skillset, named)
    for name, times in Counter(skillset.types).items():
        if times > 1:
            yield error("ALU201", f"type `{name}` is declared twice", skillset.span)
    yield from one_in_code("skill", skillset.skills, ros_types.camel)
    if not ros_types.is_package_name(skillset.name):
        hint = "a ROS name has a-z, 0-9 and single _, and begins with a letter"
        yield for_generator("ALU216", f"`{skillset.name}` can't be the name of a ROS package", skillset.span, hint=hint)
    for data in skillset.data:
        yield from ros_name("data", data)


def _resources(skillset: Skillset) -> Iterator[Diagnostic]:
    for resource in skillset.resources:
        yield from _states(resource)
        yield from _initial(resource)
        yield from _reach(resource)
        yield from _silence(resource)


def _states(resource: Resource) -> Iterator[Diagnostic]:
    for state, times in Counter(resource.states).items():
        if times > 1:
            yield error("ALU201", f"state `{state}` of `{resource.name}` is listed twice", resource.span)
    seen: set[tuple[str, str, bool]] = set()
    for transition in resource.transitions:
        for state in dict.fromkeys((transition.source, transition.target)):
            if state not in resource.states:
                word = first_word if state == transition.source else last_word
                yield unknown_state(resource, state, word(transition.span, state))
        key = (transition.source, transition.target, transition.extern)
        if key in seen:
            yield error(
                "ALU201",
                f"the transition `{transition.source} -> {transition.target}` of `{resource.name}` is given twice",
                transition.span,
            )
        seen.add(key)


def _initial(resource: Resource) -> Iterator[Diagnostic]:
    ends = {state for transition in resource.transitions for state in (transition.source, transition.target)}
    if not resource.initial:
        hint = f"add `initial {resource.states[0]}`" if resource.states else "add `initial STATE`"
        yield error("ALU207", f"resource `{resource.name}` has no initial state", resource.span, hint=hint)
        return
    message = f"the initial state `{resource.initial}` of `{resource.name}` has no transition"
    hint = nearest(resource.initial, ends)
    if resource.initial not in resource.states:
        yield error("ALU208", message, resource.span, hint=hint)
    elif ends and resource.initial not in ends:
        # A state that is not listed may well be a slip of the pen; one that is listed is meant.
        listed = resource.states != occurring(resource.initial, resource.transitions)
        yield (warning if listed else error)("ALU208", message, resource.span, hint="" if listed else hint)


def _reach(resource: Resource) -> Iterator[Diagnostic]:
    if not resource.initial or resource.initial not in resource.states:
        return
    reached = resource.reachable()
    for state in resource.states:
        if state not in reached:
            message = f"state `{state}` of `{resource.name}` can't be reached from `{resource.initial}`"
            yield warning("ALU302", message, resource.span)


def _silence(resource: Resource) -> Iterator[Diagnostic]:
    """Yield why a silence can't be noticed, or what could not be reported after it."""
    silence_s, initial = resource.silence_s, resource.initial
    if silence_s is None or initial not in resource.states:
        return
    if not silence_s >= SHORTEST_SILENCE_S:
        hint = f"reporters send a heartbeat every 0.5 s: take {SHORTEST_SILENCE_S:g} s or more"
        yield error("ALU226", f"the silence of `{resource.name}` is {silence_s:g} s", resource.span, hint=hint)
    reported = dict.fromkeys(transition.target for transition in resource.transitions if transition.extern and transition.target != initial)
    if not reported:
        message = f"`{resource.name}` has a silence, and nobody reports it: no extern transition leads away from `{initial}`"
        yield error("ALU226", message, resource.span, hint=f"add `extern {initial} -> STATE`, or leave `silence` out")
    for state in reported:
        if not resource.has_transition(initial, state, extern=True):
            message = f"after a silence `{resource.name}` is `{initial}`, and `{state}` could not be reported from there"
            yield error("ALU226", message, resource.span, hint=f"add `extern {initial} -> {state}`")


def _types(skillset: Skillset) -> Iterator[Diagnostic]:
    used: set[str] = set()
    known = {*skillset.types, *ros_types.PRIMITIVES}
    messages = [s.progress for s in skillset.skills if s.progress and s.progress.message]
    typed: list[tuple[str, Span]] = [(element.type, element.span) for element in typed_elements(skillset)]
    typed += [(progress.message, progress.span) for progress in messages]
    for name, span in typed:
        used.add(name)
        if name not in known:
            hint = nearest(name, known)
            hint = hint if hint.startswith("did") else f"declare it with `type {name}`"
            yield error("ALU205", f"unknown type `{name}`", span, hint=hint)
    for name in skillset.types:
        if name not in used:
            yield warning("ALU303", f"type `{name}` is never used", skillset.span)


def _periods(skillset: Skillset) -> Iterator[Diagnostic]:
    for data in skillset.data:
        if data.period_s is not None and data.period_s <= 0:
            yield error("ALU211", f"the period of data `{data.name}` is {data.period_s:g} s; it must be positive", data.span)
    for skill in skillset.skills:
        progress = skill.progress
        if progress and progress.period_s <= 0:
            message = f"the progress period of `{skill.name}` is {progress.period_s:g} s; it must be positive"
            yield error("ALU211", message, progress.span)
        elif progress and progress.deadline_s is not None and progress.deadline_s <= progress.period_s:
            message = f"the progress deadline of `{skill.name}` is {progress.deadline_s:g} s, its period {progress.period_s:g} s"
            yield error("ALU220", message, progress.span, hint="the deadline should leave time for several reports")


def _events(skillset: Skillset) -> Iterator[Diagnostic]:
    for event in skillset.events:
        yield from condition_findings(skillset, event.guard, f"the guard of `{event.name}`", data_allowed=False)
        # What happens by itself may take any transition: it speaks for the functional layer.
        yield from effect_findings(skillset, event.effect, any_transition=True)


def _properties(skillset: Skillset) -> Iterator[Diagnostic]:
    for prop in skillset.properties:
        for condition in (prop.condition, prop.consequence):
            if condition is not None:
                where = f"property `{prop.name}`"
                yield from condition_findings(skillset, condition, where, data_allowed=False, executions_allowed=True)


RULES: Sequence[Callable[[Skillset], Iterable[Diagnostic]]] = (
    _skillset_names,
    _resources,
    _types,
    _periods,
    unit_kinds,
    _events,
    _properties,
)
