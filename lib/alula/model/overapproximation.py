"""Over-approximate a skillset by one over resources alone: data and time may be anything.

A precondition becomes what it asks of resources if the data are right. An invariant over data, or one with a ``hold``, becomes what it
asks of resources at once, whatever the data; that data (also the lack of a fresh value) or time break it all the same is a step of
its own, where its ``Breaker`` says. A progress deadline ends an execution as a failure does, which may come at any time. Every run of
the skillset is a run of the over-approximation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from alula.model.conditions import data_of, whatever_the_data
from alula.model.deadlines import waits
from alula.model.expressions import TRUE, Expression, Not
from alula.model.model import Invariant, Skill, Skillset


@dataclass(frozen=True)
class Breaker:
    """Data or time may break this invariant of an execution in every situation that fulfils ``when``."""

    skill: str
    invariant: str
    when: Expression


@dataclass(frozen=True)
class OverApproximation:
    """A ``skillset`` over resources alone, the ``original`` with its data, and what data and time may break."""

    skillset: Skillset
    original: Skillset
    breakers: tuple[Breaker, ...]


def over_approximate(skillset: Skillset) -> OverApproximation:
    """Return the skillset over resources alone; preconditions keep their names."""
    breakers = tuple(
        Breaker(skill.name, one.name, Not(whatever_the_data(one.condition, unknown=False)))
        for skill in skillset.skills
        for one in skill.invariants
        if not at_once(one)
    )
    events = tuple(replace(one, guard=whatever_the_data(one.guard, unknown=True)) for one in skillset.events)
    return OverApproximation(replace(skillset, skills=tuple(map(_skill, skillset.skills)), events=events), skillset, breakers)


def at_once(invariant: Invariant) -> bool:
    """Return whether resources alone decide about the invariant, at each step."""
    return not waits(invariant) and not data_of(invariant.condition)


def _skill(skill: Skill) -> Skill:
    preconditions = tuple(replace(one, condition=whatever_the_data(one.condition, unknown=True)) for one in skill.preconditions)
    progress = None if skill.progress is None else replace(skill.progress, deadline_s=None)
    return replace(skill, preconditions=preconditions, invariants=tuple(map(_invariant, skill.invariants)), progress=progress)


def _invariant(invariant: Invariant) -> Invariant:
    if at_once(invariant):
        return replace(invariant, hold=None)
    condition = TRUE if waits(invariant) else whatever_the_data(invariant.condition, unknown=True)
    return replace(invariant, condition=condition, hold=None)
