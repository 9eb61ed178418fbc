"""The purposes of skills: their roles in the models, and what follows from models and mocks.

- A skill that has a successful result achieves something; one that has none is there to run: it watches, or holds something.
- What a skill takes when it starts, it holds while it runs.
- Skills of one role with the same inputs stand for one another. Where one of two has no role, they do when they achieve the same result
  with the same resource, or watch for the same skillset. Each may need what the other does not.
- What one of them holds and its stand-in does not has to be held by another skill beside it.
- What a skill brings about in the functional layer is what its mock says (``then`` of ``mock.yaml``).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from alula.common.robots import fleet_name
from alula.model.conditions import NO_DATA, judge
from alula.model.expressions import ResourceIs
from alula.model.model import Resource, Skill, Skillset


@dataclass(frozen=True)
class Purpose:
    """A skill and its purpose.

    Attributes:
        skillset: the one that has it.
        skill: its model.
        achieves: its successful results; none: it is there to run.
        holds: the resources that its start changes, each with the state that it takes it to.
        robot: of a fleet, the one that has it.
    """

    skillset: Skillset
    skill: Skill
    achieves: frozenset[str]
    holds: Mapping[str, str]
    robot: str

    @property
    def name(self) -> str:
        """``skillset.skill``."""
        return f"{self.skillset.name}.{self.skill.name}"

    @property
    def roles(self) -> frozenset[str]:
        """The roles that its model provides."""
        return frozenset(one.name for one in self.skill.provides)

    @property
    def inputs(self) -> Mapping[str, str]:
        """The types of its inputs, by their names."""
        return {one.name: one.type for one in self.skill.inputs}


class Purposes:
    """The purposes of the skills of a robot, or of the ``robots`` of a fleet; ``brought``: what their mocks bring about.

    In a fleet, no robot's skill stands for another one's, or fills a role that another one needs: it does so somewhere else.
    """

    def __init__(
        self,
        skillsets: Sequence[Skillset],
        brought: Mapping[str, Collection[tuple[str, str]]] | None = None,
        robots: Collection[str] = (),
    ) -> None:
        self.brought = brought or {}
        self.known = {f"{of.name}.{one.name}": _purpose(of, one, _robot_of(of, robots)) for of in skillsets for one in of.skills}

    def stand_ins(self, name: str) -> list[Purpose]:
        """Return the skills that may stand in for this one, the most similar first."""
        mine = self.known[name]
        found = [one for one in self.known.values() if one.name != name and one.robot == mine.robot and _stands_for(one, mine)]
        return sorted(found, key=lambda one: (len(_words(one) ^ _words(mine)), one.name))

    def alike(self, name: str) -> list[Purpose]:
        """Return the skills that share a role, or have the same inputs and successes, also those that no branch uses."""
        mine = self.known[name]
        same = {one.name for one in self._of(mine) if (one.inputs, one.achieves) == (mine.inputs, mine.achieves)}
        return [one for one in self.known.values() if one.name != name and (one.name in same or mine.roles & one.roles)]

    def watching(self, role: str, needed: Purpose) -> list[Purpose]:
        """Return the skills that fill a role while they run, for one that needs it."""
        return [one for one in self.known.values() if not one.achieves and role in one.roles and one.robot == needed.robot]

    def holders(self, needed: Purpose, instead: Purpose) -> list[Purpose] | None:
        """Return skills that hold what ``needed`` holds and ``instead`` does not, one for each resource; None: nothing holds one."""
        found: list[Purpose] = []
        for resource, state in needed.holds.items():
            if resource in instead.holds:
                continue
            holders = [one for one in self._of(needed) if not one.achieves and dict(one.holds) == {resource: state}]
            if not holders:
                return None
            found += holders[:1]
        return found

    def bringers(self, holder: Purpose) -> list[Purpose]:
        """Return the skills that bring about what this one holds: they take the same resources, have its inputs, and end by themselves."""
        same = (one for one in self._of(holder) if one.achieves and one.holds == holder.holds)
        return [one for one in same if holder.inputs.items() <= one.inputs.items()]

    def _of(self, other: Purpose) -> Iterator[Purpose]:
        return (one for one in self.known.values() if one.skillset.name == other.skillset.name)


def _robot_of(skillset: Skillset, robots: Collection[str]) -> str:
    return max((one for one in robots if skillset.name.startswith(fleet_name(one, ""))), key=len, default="")


def _purpose(skillset: Skillset, skill: Skill, robot: str) -> Purpose:
    achieves = frozenset(one.name for one in skill.successes)
    return Purpose(skillset, skill, achieves, {one.resource: one.target for one in skill.start.assignments}, robot)


def _stands_for(one: Purpose, other: Purpose) -> bool:
    if one.roles and other.roles:
        return bool(one.roles & other.roles) and one.inputs == other.inputs
    if one.skillset.name != other.skillset.name or bool(one.achieves) != bool(other.achieves) or one.inputs != other.inputs:
        return False
    if not other.achieves:
        return bool(one.skill.invariants) and not one.holds and not other.holds
    return bool(one.inputs) and one.achieves == other.achieves and bool(set(one.holds) & set(other.holds) or not other.holds)


def _words(one: Purpose) -> set[str]:
    return set(one.skill.name.split("_"))


# --- conditions ---------------------------------------------------------------------------------------------------------


def broken_by(skill: Skill, resource: str, state: str) -> str | None:
    """Return the invariant that is false in a state, else the precondition; None: the skill can start and run."""
    conditions = [(one.name, one.condition) for one in skill.invariants] + [(one.name, one.condition) for one in skill.preconditions]
    return next((name for name, condition in conditions if judge(condition, {resource: state}, NO_DATA) is False), None)


def asked_of_others(purpose: Purpose) -> list[tuple[Resource, str]]:
    """Return the resources that a skill requires and only the functional layer changes, each with its state, where it is exactly one."""
    found: dict[str, tuple[Resource, str]] = {}
    for precondition in purpose.skill.preconditions:
        condition = precondition.condition
        if isinstance(condition, ResourceIs) and not condition.negated:
            resource = purpose.skillset.resource(condition.resource)
            if all(one.extern for one in resource.transitions):
                found.setdefault(resource.name, (resource, condition.state))
    return list(found.values())


def shows_done(purpose: Purpose) -> tuple[str, str] | None:
    """Return the resource and its state that a success leaves and that bars another start of the skill, until others change it.

    None: after a success it can be started again, as far as its own effects go.
    """
    changes = [{one.resource: one.target for one in result.effect.assignments} for result in purpose.skill.successes]
    several = changes[0].items() if changes else ()
    everywhere = [(resource, state) for resource, state in several if all(one.get(resource) == state for one in changes)]
    return next(((resource, state) for resource, state in everywhere if _refuses(purpose.skill, resource, state)), None)


def _refuses(skill: Skill, resource: str, state: str) -> bool:
    return any(judge(one.condition, {resource: state}, NO_DATA) is False for one in skill.preconditions)
