"""A skillset of the search as managers can run it: a resource more stands for the data, which conditions over data ask.

The search leaves open what data and time say. In a play somebody has to say it: an invariant over data or with a ``hold`` breaks, and a
precondition over data is false, where the resource is in the state that is named after it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

from alula.model.conditions import data_of
from alula.model.expressions import And, Expression, Not, ResourceIs
from alula.model.model import Resource, Skill, Skillset, Transition
from alula.model.overapproximation import OverApproximation
from alula.prove.mission.managers import searched
from alula.prove.playing import without_parameters

AS_WANTED = "as_wanted"
"""Data say what every condition asks for."""


@dataclass(frozen=True)
class Playable:
    """A skillset for a play; ``data`` is the resource that stands for the data, empty where no condition asks any."""

    skillset: Skillset
    data: str = ""


@lru_cache(maxsize=32)  # many runs are played of one mission
def playable(skillset: Skillset) -> Playable:
    """Return a skillset without inputs, outputs and data, and with the transitions that the search counts as extern."""
    model = searched(skillset)
    against = list(dict.fromkeys(_against(model)))
    bare = without_parameters(model.skillset)
    if not against:
        return Playable(bare)
    taken = {*(one.name for one in skillset.resources), *(one.name for one in skillset.data)}
    name = next(one for one in ("data", *(f"data_{number}" for number in range(2, len(taken) + 3))) if one not in taken)
    transitions = [Transition(*ends, extern=True) for one in against for ends in ((AS_WANTED, one), (one, AS_WANTED))]
    data = Resource(name, (AS_WANTED, *against), AS_WANTED, tuple(transitions))
    skills = tuple(_asking(one, name, frozenset(against)) for one in bare.skills)
    return Playable(replace(bare, resources=(*bare.resources, data), skills=skills), name)


def breaks(skill: str, invariant: str) -> str:
    """Return the state of the data that breaks an invariant of what runs."""
    return f"breaks_{invariant}_of_{skill}"


def refuses(skill: str, precondition: str) -> str:
    """Return the state of the data in which a precondition is false."""
    return f"refuses_{precondition}_of_{skill}"


def _against(model: OverApproximation) -> Iterator[str]:
    for breaker in model.breakers:
        yield breaks(breaker.skill, breaker.invariant)
    for skill in model.original.skills:
        for one in skill.preconditions:
            if any(data_of(one.condition)):
                yield refuses(skill.name, one.name)


def _asking(skill: Skill, data: str, states: frozenset[str]) -> Skill:
    def asking(condition: Expression, state: str) -> Expression:
        return And((condition, Not(ResourceIs(data, state)))) if state in states else condition

    return replace(
        skill,
        preconditions=tuple(replace(one, condition=asking(one.condition, refuses(skill.name, one.name))) for one in skill.preconditions),
        invariants=tuple(replace(one, condition=asking(one.condition, breaks(skill.name, one.name))) for one in skill.invariants),
    )
