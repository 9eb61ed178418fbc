"""The robot's skills as types of node, and what the models tell of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property

from alula.language.messages import NO_MESSAGES, Messages
from alula.missions.skill_types import SEPARATOR, SUCCESS_PORT
from alula.model.model import ResultKind, Skill, Skillset
from alula.trees.node import NodeConfig, pointer


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

    def of(self, config: NodeConfig) -> Skill | None:
        """Return the skill that a leaf is."""
        return self.get(config.type.name)

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

    def successes(self, config: NodeConfig) -> frozenset[str]:
        """Return the results with which a leaf succeeds: what the file narrows them to, else those that the model calls a success."""
        skill = self.of(config)
        narrowed = named_results(config)
        if skill is None:
            return frozenset()
        known = frozenset(result.name for result in skill.results)
        if narrowed is not None and narrowed <= known:
            return narrowed
        return frozenset(name for name in known if skill.kind_of(name) is ResultKind.SUCCESS)


def named_results(config: NodeConfig) -> frozenset[str] | None:
    """Return the results that the file says are a success, None where it says nothing, or names an entry."""
    attribute = config.element.attributes.get(SUCCESS_PORT)
    if attribute is None or pointer(attribute.value, SUCCESS_PORT) is not None:
        return None
    return frozenset(attribute.value.split(SEPARATOR)) - {""}
