"""What the models tell of a mission: units, results, resources, names in scripts."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from alula.check.problems import of_element, of_value
from alula.check.reach import is_parallel
from alula.check.resources import clash
from alula.check.skills import Skills, named_results
from alula.check.whole import Whole
from alula.common.suggestions import nearest, quoted
from alula.missions.skill_types import OUTCOME_PORT, SUCCESS_PORT
from alula.model.model import Skill
from alula.model.units import KIND_OF_UNIT, UNIT_IN_SI
from alula.trees.document import Attribute
from alula.trees.errors import Problem
from alula.trees.node import NodeConfig

_NUMBER_WITH_UNIT = re.compile(r"\s*[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?\s*([A-Za-z%/]+)\s*")


@dataclass(frozen=True)
class SkillRules:
    """The rules of a mission; each takes a whole tree and yields problems."""

    skills: Skills

    def units(self, whole: Whole) -> Iterator[Problem]:
        """Yield numbers that are written with a unit."""
        for config in whole.root.walk():
            for attribute in config.port_attributes():
                port = config.type.ports.get(attribute.name)
                match = _NUMBER_WITH_UNIT.fullmatch(attribute.value)
                if port is not None and port.unit and match and match[1] in UNIT_IN_SI:
                    yield _wrong_unit(attribute, match[1], port.unit)

    def results(self, whole: Whole) -> Iterator[Problem]:
        """Yield results that the skill does not have, and those after which the mission just fails."""
        for config in whole.root.walk():
            skill = self.skills.of(config)
            if skill is None:
                continue
            known = [result.name for result in skill.results]
            for name in sorted((named_results(config) or frozenset()) - set(known)):
                cure = nearest(name, known)
                yield of_value("ALU618", config.element.attributes[SUCCESS_PORT], f"'{config.type.name}' has no result `{name}`", cure)
            left = [name for name in known if name not in self.skills.successes(config)]
            if left and not any(_deals(parent, child) for parent, child in config.above()) and not _is_asked(config, whole):
                yield _ignored(config, left)

    def resources(self, whole: Whole) -> Iterator[Problem]:
        """Yield skills in two branches of a Parallel that can't run at once."""
        for config in whole.root.walk():
            if not is_parallel(config):
                continue
            branches = [[(leaf, skill) for leaf in child.walk() if (skill := self.skills.of(leaf))] for child in config.children]
            for number, branch in enumerate(branches):
                for leaf, skill in branch:
                    others = [one for later in branches[:number] for one in later]
                    yield from _clashes(config, leaf, skill, others)


def _wrong_unit(attribute: Attribute, written: str, expected: str) -> Problem:
    kinds = KIND_OF_UNIT.get(written, written), KIND_OF_UNIT.get(expected, expected)
    if kinds[0] != kinds[1]:
        return of_value(
            "ALU606", attribute, f"`{attribute.name}` is {kinds[1]} in {expected}, not {kinds[0]}", f"write a number of {expected}"
        )
    cure = f"write the number alone, in {expected}"
    return of_value("ALU606", attribute, f"`{attribute.name}` is in {expected}, and is written without its unit", cure)


def _deals(parent: NodeConfig, child: NodeConfig) -> bool:
    """Return whether a node does something about the failure of a child other than to fail, too."""
    place = parent.children.index(child)
    if "_onFailure" in child.element.attributes:
        return True
    return parent.ticking.heeds_failure(place, len(parent.children), parent.ports.get)


def _is_asked(config: NodeConfig, whole: Whole) -> bool:
    mine = config.element.attributes
    return OUTCOME_PORT in mine or "_onFailure" in mine or "_onFailure" in whole.root.element.attributes


def _ignored(config: NodeConfig, left: list[str]) -> Problem:
    message = f"no branch deals with {quoted(left)} of '{config.name}': the mission fails"
    cure = "put a Fallback around it with what is to be done then, or ForceFailure where that is meant"
    return of_element("ALU609", config.element, message, cure, warning=True)


def _clashes(parallel: NodeConfig, leaf: NodeConfig, skill: Skill, others: list[tuple[NodeConfig, Skill]]) -> Iterator[Problem]:
    for other, known in others:
        if leaf.type.name.partition(".")[0] != other.type.name.partition(".")[0]:
            continue
        resource = clash(skill, known)
        if resource:
            sure = _at_once(parallel, leaf) and _at_once(parallel, other)
            verb = "need" if sure else "may need"
            message = f"'{leaf.name}' and '{other.name}', in two branches of '{parallel.name}', {verb} `{resource}` at once"
            yield of_element("ALU613", leaf.element, message, "put them one after the other", warning=not sure)
            return


def _at_once(parallel: NodeConfig, leaf: NodeConfig) -> bool:
    """Return whether nothing but sequences, of which it is the first, and no condition stands between the leaf and the Parallel."""
    guards = {"_skipIf", "_while", "_successIf", "_failureIf"}
    if guards & set(leaf.element.attributes):
        return False
    for parent, child in leaf.above():
        if parent is parallel:
            return True
        first = parent.children[0] is child and parent.ticking.begins_with_first()
        if not first or guards & set(parent.element.attributes):
            return False
    return False
