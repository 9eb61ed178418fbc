"""The robot's skills as types of node, and what the models tell of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from functools import cached_property

from alula.check.sites import Site
from alula.check.traits import PlainTraits
from alula.language.messages import NO_MESSAGES, Messages
from alula.missions.skill_types import SEPARATOR, SUCCESS_PORT
from alula.model.model import ResultKind, Skill, Skillset
from alula.trees.ends import ENDS, FAILS, Ends
from alula.trees.node import pointer


class Skills:
    """The skills of some skillsets; ``messages``: what is known of their data's fields."""

    def __init__(self, skillsets: Iterable[Skillset], messages: Messages = NO_MESSAGES) -> None:
        self.messages = messages
        self.skillsets = {skillset.name: skillset for skillset in skillsets}

    def get(self, name: str) -> Skill | None:
        """Return a skill by its whole name, as ``navigation.goto``."""
        skillset, _, skill = name.partition(".")
        known = self.skillsets.get(skillset)
        return known.skill_index.get(skill) if known else None

    def of(self, site: Site) -> Skill | None:
        """Return the skill that a leaf is."""
        return self.get(site.kind)

    @cached_property
    def names(self) -> Mapping[str, frozenset[str]]:
        """The names of each kind that functions ask of; ends without, the others with their skillset."""
        sets = self.skillsets.values()
        skills = [(one.name, skill) for one in sets for skill in one.skills]
        ends = {end.name for _, skill in skills for end in skill.results}
        ends |= {end.name for _, skill in skills for end in skill.preconditions}
        ends |= {end.name for _, skill in skills for end in skill.invariants}
        return {
            "skill": frozenset(f"{skillset}.{skill.name}" for skillset, skill in skills),
            "end": frozenset(ends),
            "data": frozenset(f"{one.name}.{data}" for one in sets for data in one.data_index),
            "resource": frozenset(f"{one.name}.{resource.name}" for one in sets for resource in one.resources),
        }

    @cached_property
    def states(self) -> frozenset[str]:
        """The names of all states of all resources."""
        return frozenset(state for one in self.skillsets.values() for resource in one.resources for state in resource.states)

    def successes(self, site: Site) -> frozenset[str]:
        """Return the results with which a leaf succeeds: what the file narrows them to, else those that the model calls a success."""
        skill = self.of(site)
        narrowed = named_results(site)
        if skill is None:
            return frozenset()
        known = frozenset(result.name for result in skill.results)
        if narrowed is not None and narrowed <= known:
            return narrowed
        return frozenset(name for name in known if skill.kind_of(name) is ResultKind.SUCCESS)


def named_results(site: Site) -> frozenset[str] | None:
    """Return the results that the file says are a success, None where it says nothing, or names an entry."""
    attribute = site.element.attributes.get(SUCCESS_PORT)
    if attribute is None or pointer(attribute.value, SUCCESS_PORT) is not None:
        return None
    return frozenset(attribute.value.split(SEPARATOR)) - {""}


class SkillTraits(PlainTraits):
    """What is known of BehaviorTree.CPP's nodes and of the robot's skills."""

    def __init__(self, skills: Skills, names: Collection[str] = ()) -> None:
        super().__init__({*names, *skills.states})
        self._skills = skills

    def ends(self, site: Site) -> Ends | None:
        """Any skill may fail: it may be refused, interrupted, or stopped by an invariant."""
        if self._skills.of(site) is None:
            return super().ends(site)
        return ENDS if self._skills.successes(site) else FAILS

    def runs(self, site: Site) -> bool | None:
        """Every skill takes several ticks."""
        return True if self._skills.of(site) is not None else super().runs(site)

    def endless(self, site: Site) -> bool:
        """Tell whether none of its results is a success."""
        return self._skills.of(site) is not None and not self._skills.successes(site)
