"""What the models tell of a mission: units, results, resources, names in scripts."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from alula.common.suggestions import nearest, quoted
from alula.missions.check.resources import clash
from alula.missions.check.skills import Skills, named_results
from alula.missions.filed.world import FUNCTIONS
from alula.missions.skill_types import OUTCOME_PORT, PORT_TYPES, SUCCESS_PORT
from alula.model.model import Skill
from alula.model.units import KIND_OF_UNIT, UNIT_IN_SI
from alula.trees.check.checking import Whole
from alula.trees.check.problems import in_value, of_element, of_value
from alula.trees.check.reach import BRANCHES, IN_TURN, is_parallel
from alula.trees.check.scripts import after, before, within
from alula.trees.check.sites import Site
from alula.trees.check.traits import F
from alula.trees.document import Attribute
from alula.trees.errors import Problem
from alula.trees.script.syntax import Assignment, Call, Comparison, Literal, Name, Node, walk

_NUMBER_WITH_UNIT = re.compile(r"\s*[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?\s*([A-Za-z%/]+)\s*")


@dataclass(frozen=True)
class SkillRules:
    """The rules of a mission; each takes a whole tree and yields problems."""

    skills: Skills

    def units(self, whole: Whole) -> Iterator[Problem]:
        """Yield numbers that are written with a unit."""
        for site in whole.root.walk():
            for attribute in site.ports():
                port = site.type.ports.get(attribute.name) if site.type else None
                match = _NUMBER_WITH_UNIT.fullmatch(attribute.value)
                if port is not None and port.unit and match and match[1] in UNIT_IN_SI:
                    yield _wrong_unit(attribute, match[1], port.unit)

    def results(self, whole: Whole) -> Iterator[Problem]:
        """Yield results that the skill does not have, and those after which the mission just fails."""
        for site in whole.root.walk():
            skill = self.skills.of(site)
            if skill is None:
                continue
            known = [result.name for result in skill.results]
            for name in sorted((named_results(site) or frozenset()) - set(known)):
                cure = nearest(name, known)
                yield of_value("ALU618", site.element.attributes[SUCCESS_PORT], f"'{site.kind}' has no result `{name}`", cure)
            left = [name for name in known if name not in self.skills.successes(site)]
            if left and not any(_deals(parent, child) for parent, child in site.above()) and not _is_asked(site, whole):
                yield _ignored(site, left)

    def resources(self, whole: Whole) -> Iterator[Problem]:
        """Yield skills in two branches of a Parallel that can't run at once."""
        for site in whole.root.walk():
            if not is_parallel(site):
                continue
            branches = [[(leaf, skill) for leaf in child.walk() if (skill := self.skills.of(leaf))] for child in site.children]
            for number, branch in enumerate(branches):
                for leaf, skill in branch:
                    others = [one for later in branches[:number] for one in later]
                    yield from _clashes(site, leaf, skill, others)

    def names(self, whole: Whole) -> Iterator[Problem]:
        """Yield dotted names, states and functions in scripts that nothing of the robot has."""
        for site in whole.root.walk():
            for attribute in (*before(site), *within(site), *after(site)):
                program = whole.scripts.program(attribute)
                for statement in program.statements if program else ():
                    yield from self._unguarded(attribute, statement)
                    asked: set[int] = set()
                    for node in walk(statement):
                        yield from self._node(attribute, node, asked)

    def _node(self, attribute: Attribute, node: Node, asked: set[int]) -> Iterator[Problem]:
        match node:
            case Call():
                asked |= {id(argument) for argument in node.arguments}
                yield from self._call(attribute, node)
            case Comparison():
                yield from self._states(attribute, node)
            case Name(name=name) if "." in name and id(node) not in asked:
                yield from self._dotted(attribute, node)

    def _call(self, attribute: Attribute, node: Call) -> Iterator[Problem]:
        place = (node.offset, node.offset + len(node.function))
        function = FUNCTIONS.get(node.function)
        if function is None:
            yield in_value("ALU615", attribute, place, f"there is no function `{node.function}`", nearest(node.function, FUNCTIONS))
            return
        kind = function.kind
        name = _name_of(node.arguments[0]) if len(node.arguments) == 1 else None
        if name is None and (len(node.arguments) != 1 or isinstance(node.arguments[0], Literal)):
            yield in_value("ALU615", attribute, place, f"`{node.function}` takes one name", f"the name of one {kind}")
        elif name is not None and name not in self.skills.names[kind]:
            one = node.arguments[0]
            cure = nearest(name, self.skills.names[kind])
            yield in_value("ALU615", attribute, (one.offset, one.end), f"there is no {kind} `{name}`", cure)

    def _dotted(self, attribute: Attribute, node: Name) -> Iterator[Problem]:
        skillset_name, _, name = node.name.partition(".")
        place = (node.offset, node.end)
        skillset = self.skills.skillsets.get(skillset_name)
        if skillset is None:
            cure = nearest(skillset_name, self.skills.skillsets)
            yield in_value("ALU615", attribute, place, f"there is no skillset `{skillset_name}`", cure)
        elif name.partition(".")[0] in skillset.data_index:
            data, _, field = name.partition(".")
            plain = skillset.data_index[data].type in PORT_TYPES
            if plain and field:
                yield in_value("ALU615", attribute, place, f"`{skillset_name}.{data}` has no fields", f"write `{skillset_name}.{data}`")
            elif not plain and not field:
                yield in_value("ALU615", attribute, place, f"`{node.name}` is no single value", f"name a field: `{node.name}.FIELD`")
        elif name not in skillset.resource_index:
            cure = nearest(name, {*skillset.resource_index, *skillset.data_index})
            yield in_value("ALU615", attribute, place, f"`{skillset_name}` has no resource and no data `{name}`", cure)

    def _unguarded(self, attribute: Attribute, statement: Node) -> Iterator[Problem]:
        """Yield data that an assignment takes: they may be unknown when it does, and then it can't."""
        if isinstance(statement, Assignment):
            for node in walk(statement.value):
                data = ".".join(node.name.split(".", 2)[:2]) if isinstance(node, Name) else ""
                if data in self.skills.names["data"] and not self._asked_only(statement.value, node):
                    message = f"`{data}` may have no fresh value here, and an entry takes no unknown one"
                    yield in_value("ALU615", attribute, (node.offset, node.end), message, "ask for data in conditions")

    def _asked_only(self, value: Node, name: Node) -> bool:
        """Tell whether a name is but an argument, such as that of `fresh`."""
        return any(isinstance(call, Call) and any(one is name for one in call.arguments) for call in walk(value))

    def _states(self, attribute: Attribute, node: Comparison) -> Iterator[Problem]:
        for one in node.operands:
            states = self._states_of(one)
            for other in node.operands if states else ():
                if other is one or not isinstance(other, Name | Literal) or (isinstance(other, Name) and "." in other.name):
                    continue
                name = other.name if isinstance(other, Name) else str(other.value)
                if name not in states:
                    shown = one.name if isinstance(one, Name) else ""
                    cure = nearest(name, states) or f"it has {quoted(states)}"
                    yield in_value("ALU615", attribute, (other.offset, other.end), f"`{shown}` has no state `{name}`", cure)

    def _states_of(self, node: Node) -> tuple[str, ...]:
        if not isinstance(node, Name) or node.name.count(".") != 1:
            return ()
        skillset, name = node.name.split(".")
        known = self.skills.skillsets.get(skillset)
        return known.resource_index[name].states if known and name in known.resource_index else ()


def _name_of(node: Node) -> str | None:
    """Return the name that an argument is, bare or as a text; None where it is computed."""
    if isinstance(node, Name):
        return node.name
    return node.value if isinstance(node, Literal) and isinstance(node.value, str) else None


def _wrong_unit(attribute: Attribute, written: str, expected: str) -> Problem:
    kinds = KIND_OF_UNIT.get(written, written), KIND_OF_UNIT.get(expected, expected)
    if kinds[0] != kinds[1]:
        return of_value(
            "ALU606", attribute, f"`{attribute.name}` is {kinds[1]} in {expected}, not {kinds[0]}", f"write a number of {expected}"
        )
    cure = f"write the number alone, in {expected}"
    return of_value("ALU606", attribute, f"`{attribute.name}` is in {expected}, and is written without its unit", cure)


def _deals(parent: Site, child: Site) -> bool:
    """Tell whether a node does something about the failure of a child other than to fail, too."""
    place = parent.children.index(child)
    if "_onFailure" in child.element.attributes:
        return True
    if IN_TURN.get(parent.kind) == F:
        return place + 1 < len(parent.children)
    if parent.kind in BRANCHES:
        return place == 0
    if parent.kind in {"Parallel", "ParallelAll"}:
        return (parent.given("failure_count" if parent.kind == "Parallel" else "max_failures") or "1").strip() != "1"
    if parent.kind == "TryCatch":
        return place + 1 < len(parent.children)
    return parent.kind not in IN_TURN and parent.kind not in _PASSING


_PASSING = frozenset({"SubTree", "Repeat", "Until", "Delay", "Timeout", "RunOnce", "Precondition", "SkipUnlessUpdated", "WaitValueUpdate"})
"""Nodes that fail when their child fails; of a node of another one's, nobody knows."""


def _is_asked(site: Site, whole: Whole) -> bool:
    return (
        OUTCOME_PORT in site.element.attributes or "_onFailure" in site.element.attributes or "_onFailure" in whole.root.element.attributes
    )


def _ignored(site: Site, left: list[str]) -> Problem:
    message = f"no branch deals with {quoted(left)} of '{site.name}': the mission fails"
    cure = "put a Fallback around it with what is to be done then, or ForceFailure where that is meant"
    return of_element("ALU609", site.element, message, cure, warning=True)


def _clashes(parallel: Site, leaf: Site, skill: Skill, others: list[tuple[Site, Skill]]) -> Iterator[Problem]:
    for other, known in others:
        if leaf.kind.partition(".")[0] != other.kind.partition(".")[0]:
            continue
        resource = clash(skill, known)
        if resource:
            sure = _at_once(parallel, leaf) and _at_once(parallel, other)
            verb = "need" if sure else "may need"
            message = f"'{leaf.name}' and '{other.name}', in two branches of '{parallel.name}', {verb} `{resource}` at once"
            yield of_element("ALU613", leaf.element, message, "put them one after the other", warning=not sure)
            return


def _at_once(parallel: Site, leaf: Site) -> bool:
    """Tell whether nothing but sequences, of which it is the first, and no condition stands between the leaf and the Parallel."""
    guards = {"_skipIf", "_while", "_successIf", "_failureIf"}
    if guards & set(leaf.element.attributes):
        return False
    for parent, child in leaf.above():
        if parent is parallel:
            return True
        first = parent.children[0] is child and (parent.kind in IN_TURN or parent.kind in {"SubTree", "Repeat", "RetryUntilSuccessful"})
        if not first or guards & set(parent.element.attributes):
            return False
    return False
