"""The skillsets that are measured: skills and resources by number, all alike."""

from __future__ import annotations

from dataclasses import dataclass

from alula.model.expressions import ResourceIs
from alula.model.model import (
    Assignment,
    Effect,
    Interrupt,
    Invariant,
    Parameter,
    Precondition,
    Progress,
    Resource,
    Result,
    Skill,
    Skillset,
    Transition,
)

FREE, USED, LOST = "Free", "Used", "Lost"
INPUT = "duration"
"""The one input of each skill, as the built action has it that serves for all of them."""
PROGRESS_S = 0.5


@dataclass(frozen=True)
class Case:
    """A number of skills and one of resources, not less; skill i needs and uses resource i, the others only are there."""

    skills: int
    resources: int

    @property
    def name(self) -> str:
        """What it is called on the command line."""
        number, kind = (self.skills, "skill") if self.skills == self.resources else (self.resources, "resource")
        return f"{number} {kind}{'' if number == 1 else 's'}"

    @property
    def skillset(self) -> str:
        """Name of the generated skillset, by its numbers of skills and resources."""
        return f"bench_{self.skills}_{self.resources}"


CASES = (Case(1, 1), Case(10, 10), Case(100, 100), Case(1, 10), Case(1, 100))
"""One skill with its resource begins both rows: 1, 10, 100 skills and 1, 10, 100 resources."""


def skill_name(index: int) -> str:
    """Return the name of the skill with this index."""
    return f"skill_{index}"


def resource_name(index: int) -> str:
    """Return the name of the resource with this index."""
    return f"resource_{index}"


def make_skillset(case: Case) -> Skillset:
    """Return the model of a case: each skill takes its resource, holds it as an invariant, and gives it back."""
    resources = tuple(_resource(resource_name(index)) for index in range(case.resources))
    return Skillset(case.skillset, resources=resources, skills=tuple(_skill(index) for index in range(case.skills)))


def _resource(name: str) -> Resource:
    """Return a resource that skills take and give back, and that the functional layer can lose and find."""
    transitions = (
        Transition(FREE, USED),
        Transition(USED, FREE),
        Transition(USED, LOST, extern=True),
        Transition(LOST, FREE, extern=True),
    )
    return Resource(name, (FREE, USED, LOST), FREE, transitions)


def _skill(index: int) -> Skill:
    resource = resource_name(index)
    give = Effect("give", (Assignment(resource, FREE),))
    return Skill(
        skill_name(index),
        inputs=(Parameter(INPUT, "float64"),),
        preconditions=(Precondition("free", ResourceIs(resource, FREE)),),
        start=Effect("take", (Assignment(resource, USED),)),
        invariants=(Invariant("held", ResourceIs(resource, USED)),),
        progress=Progress(PROGRESS_S),
        interrupt=Interrupt(effect=give),
        results=(Result("DONE", effect=give),),
    )
