"""Over-approximate the reachable situations, one resource at a time.

A resource is looked at with the skills that change it, and with nothing else: whatever a step asks of others may be true.
So a block's steps are more than what can happen, and its situations include all that can be reached. With them goes what is
true of every execution after a step: its invariants. All of it together is far smaller than the set of what can be reached,
which in a large skillset may have no small diagram at all.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from alula.model.model import Effect, Skill
from alula.prove.limits import Deadline
from alula.prove.skillset.diagrams import Encoded, Update, bits, runs_name

MOST_NODES = 100
"""For each variable. What makes a set's diagram larger is left out of it."""


@dataclass(frozen=True)
class Block:
    """The possible values of one resource and the executions that change it: after a step, and within one, while violations take effect."""

    settled: Any
    within: Any
    unmarked: Any
    """As ``within``, whatever is found broken."""


class Bound:
    """The over-approximation of a skillset's reachable situations, by its blocks."""

    def __init__(self, model: Encoded, deadline: Deadline) -> None:
        self.model = model
        self.bdd = model.bdd
        self.deadline = deadline
        self.rest = {skill.name: ~self.broken(skill.name) & self._counted(skill.name) for skill in model.skillset.skills}
        """For each skill: its invariants are true if it runs."""
        self.writes = {skill.name: sorted(_written(skill)) for skill in model.skillset.skills}
        self._about: dict[str, tuple[str, str]] = {}
        for resource in model.skillset.resources:
            self._about |= dict.fromkeys(bits(model.skillset, resource.name), ("resource", resource.name))
        for skill in model.skillset.skills:
            self._about |= dict.fromkeys(self._runs(skill.name), ("skill", skill.name))
        self.blocks: dict[str, Block] = {}
        writers: dict[str, list[str]] = {resource.name: [] for resource in model.skillset.resources}
        for skill_name, resources in self.writes.items():
            for name in resources:
                writers[name].append(skill_name)
        by_variable: dict[str, list[Update]] = {}
        for update in model.steps:
            for name in update.values:
                by_variable.setdefault(name, []).append(update)
        for name, skills in writers.items():
            deadline.check()
            self.blocks[name] = self._block(name, skills, by_variable)

    def broken(self, skill: str) -> Any:
        """Return the situations in which a skill runs and some invariant of it is false."""
        return self.model.any_of(first_false for _, first_false in self.model.marks.get(skill, []))

    def narrowed(self, situations: Any) -> Any:
        """Return a set without situations that the blocks of its resources and skills exclude."""
        return self.within_limits(situations, self._known(self.bdd.support(situations)))

    def around(self, *several: Any) -> Any:
        """Return the over-approximation of what is reachable, for the resources and skills of these sets."""
        return self.within_limits(self.bdd.true, self._known(set().union(*map(self.bdd.support, several))))

    def skills(self, situations: Any) -> set[str]:
        """Return the skills that a set depends on."""
        return self._parts(self.bdd.support(situations))[1]

    def within_limits(self, situations: Any, parts: Iterable[Any]) -> Any:
        """Return the intersection of a set and all parts; parts that make its diagram too large are left out, so that it is a superset."""
        most = max(MOST_NODES * len(self.bdd.vars), len(situations))
        for part in parts:
            self.deadline.check()
            both = situations & part
            if len(both) <= most:
                situations = both
        return situations

    def within(self, resources: Iterable[str]) -> Any:
        """Return the possible values of these resources within a step."""
        return self.model.all_of(self.blocks[name].within for name in sorted(set(resources)))

    def unmarked(self, resources: Iterable[str]) -> Any:
        """Return the possible values of these resources within a step, whichever invariants are marked as broken."""
        return self.model.all_of(self.blocks[name].unmarked for name in sorted(set(resources)))

    def _known(self, variables: Iterable[str]) -> list[Any]:
        resources, skills = self._parts(variables)
        resources |= {name for skill in skills for name in self.writes[skill]}
        return [*(self.blocks[name].settled for name in sorted(resources)), *(self.rest[skill] for skill in sorted(skills))]

    def _parts(self, variables: Iterable[str]) -> tuple[set[str], set[str]]:
        found = [self._about[name] for name in variables if name in self._about]
        return {name for kind, name in found if kind == "resource"}, {name for kind, name in found if kind == "skill"}

    # --- one block ------------------------------------------------------------------------------------------------

    def _block(self, resource: str, skills: list[str], by_variable: Mapping[str, list[Update]]) -> Block:
        marks = {skill: self.model.marks.get(skill, []) for skill in skills}
        broken = [name for several in marks.values() for name, _ in several]
        kept = {*bits(self.model.skillset, resource), *(name for skill in skills for name in self._runs(skill))}
        steps = list({id(u): u for name in sorted(kept) for u in by_variable.get(name, ())}.values())
        inside = kept | set(broken)
        taken = [self._seen(update, inside) for update in steps]
        ended = [self._seen(update, inside) for name in broken for update in self.model.violations[name]]
        found = [(skill, name, self._projected(first_false, inside)) for skill, several in marks.items() for name, first_false in several]
        unmarked = {skill: self.model.all_of(~self.bdd.var(name) for name, _ in several) for skill, several in marks.items()}
        whole = self.model.all_of([*unmarked.values(), *(self._projected(self.rest[skill], inside) for skill in skills)])
        values = self.model.values_of(resource, self.model.skillset.resource(resource).initial)
        within = settled = self.bdd.cube({name: values.get(name, False) for name in inside})
        before = self.bdd.false
        while within != before:
            before = within
            for update in taken:
                within |= self._taken(settled, update)
            for skill, name, first_false in found:
                within |= self.bdd.exist([name], within & unmarked[skill] & first_false) & self.bdd.var(name)
            for update in ended:
                within |= self._taken(within, update)
            settled = within & whole
        return Block(self.bdd.exist(broken, settled), within, self.bdd.exist(broken, within))

    def _seen(self, update: Update, inside: set[str]) -> Update:
        return Update(self._projected(update.guard, inside), {name: value for name, value in update.values.items() if name in inside})

    def _projected(self, situations: Any, inside: set[str]) -> Any:
        others = [name for name in self.bdd.support(situations) if name not in inside]
        return self.bdd.exist(others, situations) if others else situations

    def _taken(self, situations: Any, update: Update) -> Any:
        return self.bdd.exist(list(update.values), situations & update.guard) & self.bdd.cube(dict(update.values))

    def _runs(self, skill: str) -> list[str]:
        return [runs_name(skill, count) for count in range(1, self.model.copies[skill] + 1)]

    def _counted(self, skill: str) -> Any:
        names = self._runs(skill)
        return self.model.all_of(~self.bdd.var(more) | self.bdd.var(fewer) for fewer, more in pairwise(names))


def _written(skill: Skill) -> set[str]:
    effects: list[Effect] = [skill.start, skill.interrupt.effect]
    effects += [invariant.effect for invariant in skill.invariants] + [result.effect for result in skill.results]
    return {change.resource for effect in effects for change in effect.assignments}
