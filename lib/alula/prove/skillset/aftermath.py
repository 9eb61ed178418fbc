"""What a step can break: which executions have to be looked at after an update, and which of them touch each other.

An update is followed by fewer violations than its resources are asked for: where the bound says that an invariant about them
is false before already, or stays true, nothing is to be marked and nothing to be undone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from alula.common.graphs import reachable_from
from alula.model.expressions import ResourceIs, atoms
from alula.model.model import Skill
from alula.prove.skillset.bound import Bound
from alula.prove.skillset.diagrams import Encoded, Update


@dataclass(frozen=True)
class Group:
    """Skills that an update may break and whose violations touch each other; those of different groups end in any order alike."""

    first: tuple[str, ...]
    """Those that the update itself can break."""
    broken: tuple[str, ...]
    """The variables of their invariants."""
    idle: Any
    """None of its executions is found broken."""
    sets: frozenset[str]
    """The variables that its violations may change."""


@dataclass(frozen=True)
class Step:
    """An update with its violations; ``about`` are the variables that decide its effect, ``sets`` those that it may change."""

    update: Update
    groups: tuple[Group, ...]
    about: frozenset[str]
    sets: frozenset[str]
    ends: frozenset[str]
    """The skills of which it may end an execution."""


class Aftermath:
    """Finds the violations that may follow an update."""

    def __init__(self, model: Encoded, bound: Bound) -> None:
        self.model = model
        self.bdd = model.bdd
        self.bound = bound
        self._concerns = {skill.name: _concerns(skill) for skill in model.skillset.skills}
        self._broken = {skill.name: bound.broken(skill.name) for skill in model.skillset.skills}
        self._following: dict[str, tuple[str, ...]] = {}

    def step(self, update: Update) -> Step:
        """Return an update with the violations that may follow it."""
        direct = [skill for skill in self._watching(update) if self._breaks(update, skill)]
        whole = reachable_from(direct, self.following)
        groups = tuple(self._group(skills, direct) for skills in self._entangled([s for s in self._concerns if s in whole]))
        sets = set(update.values).union(*(group.sets for group in groups))
        about = sets | set(self.bdd.support(update.guard))
        for name in (name for group in groups for name in group.broken):
            for violation in self.model.violations[name]:
                about |= set(violation.values) | set(self.bdd.support(violation.guard))
        for skill in whole:
            about |= set(self.bdd.support(self._broken[skill]))
        ends = whole | ({update.ends} if update.ends else set())
        return Step(update, groups, frozenset(about), frozenset(sets), frozenset(ends))

    def following(self, skill: str) -> tuple[str, ...]:
        """Return the skills that the violations of one may break."""
        if skill not in self._following:
            violations = [update for name, _ in self.model.marks.get(skill, []) for update in self.model.violations[name]]
            found = {other for update in violations for other in self._watching(update) if self._breaks_within(update, other)}
            self._following[skill] = tuple(sorted(found))
        return self._following[skill]

    def watching(self, name: str, update: Update) -> Iterable[str]:
        """Return the skills that a violation may break."""
        return [skill for skill in self._watching(update) if skill in self.following(self.owner(name))]

    def owner(self, name: str) -> str:
        """Return the skill that a variable ``broken`` belongs to."""
        return name.split(" ")[1]

    def _watching(self, update: Update) -> list[str]:
        found = {skill for resource in update.changed for skill in self.model.watchers.get(resource, ())}
        return sorted(found | ({update.touches} if update.touches and update.touches in self.model.marks else set()))

    def _breaks(self, update: Update, skill: str) -> bool:
        after = update.guard & self.bound.rest[skill] & self.bdd.let(dict(update.values), self._broken[skill])
        return bool(after != self.bdd.false and self.bound.narrowed(after) != self.bdd.false)

    def _breaks_within(self, update: Update, skill: str) -> bool:
        """Return whether a violation can break an execution that none has broken before: its invariants were true."""
        after = update.guard & ~self._broken[skill] & self.bdd.let(dict(update.values), self._broken[skill])
        return bool(after != self.bdd.false and after & self.bound.within(update.changed) != self.bdd.false)

    def _group(self, skills: list[str], direct: list[str]) -> Group:
        broken = tuple(name for skill in skills for name, _ in self.model.marks.get(skill, []))
        idle = self.bdd.cube(dict.fromkeys(broken, False))
        sets = {name for one in broken for violation in self.model.violations[one] for name in violation.values} - set(broken)
        return Group(tuple(skill for skill in skills if skill in direct), broken, idle, frozenset(sets))

    def _entangled(self, skills: list[str]) -> list[list[str]]:
        """Return groups of skills: two are together when what one's violations write concerns the other."""
        groups: list[tuple[list[str], set[str], set[str]]] = []
        for skill in skills:
            writes, concerns = self._concerns[skill]
            joined, apart = [skill], []
            for others, written, concerned in groups:
                if writes & concerned or written & concerns:
                    joined, writes, concerns = [*others, *joined], writes | written, concerns | concerned
                else:
                    apart.append((others, written, concerned))
            groups = [*apart, (joined, writes, concerns)]
        return [group for group, _, _ in groups]


def _concerns(skill: Skill) -> tuple[set[str], set[str]]:
    """Return the resources that a skill's violations write, and those that concern them."""
    writes = {change.resource for invariant in skill.invariants for change in invariant.effect.assignments}
    asked = [atom for invariant in skill.invariants for atom in atoms(invariant.condition)]
    return writes, writes | {atom.resource for atom in asked if isinstance(atom, ResourceIs)}
