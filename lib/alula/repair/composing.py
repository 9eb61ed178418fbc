"""Compose trees of skills: a skill with its inputs, the skills that fill the roles it needs beside it, and one skill after another."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from alula.missions.skill_types import type_of
from alula.model.model import Parameter
from alula.model.units import told_unit
from alula.repair.branches import node
from alula.repair.courses import Course, Courses, Here, Wanted
from alula.repair.naming import Vocabulary, told_states
from alula.repair.purposes import Purpose
from alula.trees.attributes import node_name, type_name
from alula.trees.document import Element
from alula.trees.node import pointer
from alula.trees.ports import Direction
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.values import ANY

WAITING = frozenset({"WaitFor", "Awaits", "Stays"})
"""Nodes that may take more than a tick."""
TOLD_WITHIN_S = "5"
"""How long the functional layer has to report what a skill has brought about, seconds: drivers report it a moment later."""


@dataclass(frozen=True)
class Sources:
    """Where the inputs of skills come from: other uses in the files, the mission's own inputs, what a part of a tree writes itself.

    Attributes:
        files: the mission's trees.
        registry: of its nodes.
        words: what the author calls things.
        asks: whether an input that comes from nowhere becomes one of the tree's own, of its name.
    """

    files: TreeFiles
    registry: NodeRegistry
    words: Vocabulary
    asks: bool = False

    def leaf(self, purpose: Purpose, known: Mapping[str, str], within: Element | None = None) -> Element | None:
        """Return a leaf with the ``known`` values of inputs, and sources found for the others; None where an input has no source."""
        values = {one.name: known.get(one.name) or self._binding(within, purpose, one) for one in purpose.skill.inputs}
        if any(value is None and not one.default for one, value in zip(purpose.skill.inputs, values.values(), strict=True)):
            return None
        made = node(purpose.name, name=self.words.leaf(purpose.name))
        for name, value in values.items():
            if value is not None:
                made.set(name, value)
        return made

    def lacking(self, purpose: Purpose) -> list[str]:
        """Return the inputs of a skill that have no source."""
        return [one.name for one in purpose.skill.inputs if not one.default and self._binding(None, purpose, one) is None]

    @property
    def ports(self) -> list[str]:
        """The names of the mission's inputs."""
        model = self.files.models.get(self.files.main)
        return [] if model is None else [one.name for one in model.ports.values() if one.direction is Direction.INPUT]

    def _binding(self, within: Element | None, purpose: Purpose, parameter: Parameter) -> str | None:
        trees = self.files.trees.values()
        same = [one.get(parameter.name) for tree in trees for one in tree.iterate() if type_name(one) == purpose.name]
        if any(same):
            return next(one for one in same if one)
        named = self._named(purpose, parameter)
        if named is not None:
            return f"{{{named}}}"
        return self._written(within, parameter) or (f"{{{parameter.name}}}" if self.asks else None)

    def _named(self, purpose: Purpose, parameter: Parameter) -> str | None:
        """Return the mission's input that is named after skill and parameter, else after a skill without others, else after the parameter.

        So ``back_off_m`` is the ``distance`` of ``back_off`` rather than ``distance_m``.
        """
        words = {one: set(one.split("_")) for one in self.ports}
        skill = set(purpose.skill.name.split("_"))
        of_skill = [one for one in self.ports if skill <= words[one]]
        of_parameter = [one for one in self.ports if parameter.name in words[one]]
        of_both = [one for one in of_skill if one in of_parameter]
        return next(iter([*of_both, *(of_skill if len(purpose.skill.inputs) == 1 else []), *of_parameter]), None)

    def _written(self, within: Element | None, parameter: Parameter) -> str | None:
        kind, unit = type_of(parameter.type), told_unit(parameter.comment)
        found: list[str] = []
        for one in within.iterate() if within is not None else ():
            known = self.registry.get(type_name(one))
            for port in known.ports.values() if known else ():
                alike = port.type.name == kind.name and port.type is not ANY and port.unit == unit
                entry = pointer(one.get(port.name), port.name)
                if port.direction is Direction.OUTPUT and alike and entry:
                    found.append(f"{{{entry}}}")
        return found[0] if found else None


def opening(condition: str, name: str, code: str) -> list[Element]:
    """Return the first nodes of a branch: a script, behind a condition where there is one."""
    script = node("Script", name="degraded", code=code)
    return [node("ScriptCondition", name=name, code=condition), script] if condition else [script]


def first_skills(element: Element, skills: Collection[str]) -> set[str]:
    """Return the skills of a part of a tree that may start in its first tick."""
    return _first_of(element, skills)[0]


def _first_of(element: Element, skills: Collection[str]) -> tuple[set[str], bool]:
    """Return them, and whether the tick may go on behind the part."""
    if type_name(element) in skills:
        return {type_name(element)}, False
    if element.tag in WAITING:
        return set(), False
    found: set[str] = set()
    goes_on = True
    for child in element.children:
        first, child_goes_on = _first_of(child, skills)
        found |= first
        goes_on = goes_on and child_goes_on
        if not goes_on and element.tag != "Parallel":
            break
    return found, goes_on


@dataclass(frozen=True)
class Composer:
    """Composes trees from courses.

    Attributes:
        sources: of inputs.
        courses: what tells which skills can fill a role.
    """

    sources: Sources
    courses: Courses

    def after_one_another(
        self,
        course: Course,
        wanted: Mapping[int, Wanted],
        known: Sequence[Mapping[str, str]] = (),
        reused: Mapping[str, Element] | None = None,
    ) -> list[Element]:
        """Return the nodes of a course in their order, none where an input has no source.

        Steps that need the same beside them share it. States that the functional layer reports after a step are awaited before the next.

        Args:
            course: the skills.
            wanted: by the number of steps that have come before, what has to be so then.
            known: of each step, values of its inputs.
            reused: what stands for a skill, by its name.
        """
        found: list[tuple[list[Element], list[Element], str]] = []
        for number, step in enumerate(course.steps):
            leaf = (reused or {}).get(step.name) or self.sources.leaf(step, known[number] if known else {})
            watching = self._watching(step, course.heres[number])
            if leaf is None or watching is None:
                return []
            earlier = sum(one.name == step.name for one in course.steps[:number])
            if earlier:
                leaf.set("name", f"{node_name(leaf)} {earlier + 1}")
            several = course.told_between(number, wanted.get(number + 1))
            told = " && ".join(f"{name} == {state}" for name, state in several)
            name = self.sources.words.wait(told, told_states(several))
            awaits = [node("Awaits", name=name, if_=told, within=TOLD_WITHIN_S)] if told else []
            found.append(([leaf, *awaits], watching, _filled(step)))
        return self._sharing(found)

    def step(self, purpose: Purpose, here: Here, known: Mapping[str, str]) -> Element | None:
        """Return a skill with what it needs beside it; None where an input has no source."""
        leaf, watching = self.sources.leaf(purpose, known), self._watching(purpose, here)
        return None if leaf is None or watching is None else self._watched([leaf], watching, _filled(purpose))

    def _watching(self, purpose: Purpose, here: Here) -> list[Element] | None:
        """Return what fills the roles that a skill needs; None where nothing does."""
        found: list[Element] = []
        for role in purpose.skill.needs:
            leaves = (self.sources.leaf(each, {}) for each in self.courses.providers(here, role.name, purpose))
            first = next((one for one in leaves if one is not None), None)
            if first is None:
                return None
            found.append(first)
        return found

    def _sharing(self, steps: Sequence[tuple[list[Element], list[Element], str]]) -> list[Element]:
        """Return the nodes of steps, each with what runs beside it: what is the same runs from the first step that needs it to the last."""
        found: list[Element] = []
        at = 0
        while at < len(steps):
            nodes, watching, filled = steps[at]
            kinds = [one.tag for one in watching]
            end = at + 1
            for number in range(at + 1, len(steps)) if watching else ():
                others = [one.tag for one in steps[number][1]]
                if others and others != kinds:
                    break
                end = number + 1 if others else end
            together = [one for several, *_ in steps[at:end] for one in several]
            found += [self._watched(together, watching, filled)] if watching else nodes
            at = end
        return found

    def _watched(self, nodes: Sequence[Element], watching: Sequence[Element], filled: str) -> Element:
        """Return nodes that run one after another while others fill their roles, once these make progress; the first that ends ends it."""
        if not watching:
            return nodes[0]
        named = dict.fromkeys(node_name(one) for one in nodes if one.tag != "Awaits")
        name = next(iter(named)) if len(named) == 1 else "all of it"
        sees = " && ".join(f"progress({one.tag}) >= 1" for one in watching)
        wait = node("WaitFor", name=self.sources.words.wait(sees, f"there is {filled}"), if_=sees)
        inner = node("Sequence", wait, *nodes, name=f"once there is {filled}")
        return node("Parallel", *watching, inner, name=f"{name} with {filled}", success_count="1", failure_count="1")


def _filled(purpose: Purpose) -> str:
    return " and ".join(role.name.replace("_", " ") for role in purpose.skill.needs)
