"""Transitions that nothing in the model takes: no effect leads to their target, and they are not extern.

In a dialect without `extern` the functional layer takes them. A fault that is out of reach only because nothing takes a
transition is not safe, so the search counts them as taken from outside, unless the user says that the model is all there is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from alula.model.effects import effects_of
from alula.model.model import Effect, Resource, Skillset

NamedTransition = tuple[str, str, str]
"""Resource, source and target."""


def untaken(skillset: Skillset) -> frozenset[NamedTransition]:
    """Return the transitions to states that no effect leads to and no extern transition either."""
    taken = {(change.resource, change.target) for effect in _effects(skillset) for change in effect.assignments}
    return frozenset(
        (resource.name, transition.source, transition.target)
        for resource in skillset.resources
        for transition in resource.transitions
        if not transition.extern and transition.source != transition.target and (resource.name, transition.target) not in taken
    )


def opened(skillset: Skillset, transitions: frozenset[NamedTransition]) -> Skillset:
    """Return the skillset with these transitions extern as well."""
    return replace(skillset, resources=tuple(_opened(resource, transitions) for resource in skillset.resources))


def _opened(resource: Resource, transitions: frozenset[NamedTransition]) -> Resource:
    known = {(transition.source, transition.target) for transition in resource.transitions if transition.extern}
    added = tuple(
        replace(transition, extern=True)
        for transition in resource.transitions
        if (resource.name, transition.source, transition.target) in transitions
        and not transition.extern
        and (transition.source, transition.target) not in known
    )
    return replace(resource, transitions=resource.transitions + added) if added else resource


def _effects(skillset: Skillset) -> Iterator[Effect]:
    for event in skillset.events:
        yield event.effect
    for skill in skillset.skills:
        yield from effects_of(skill)
