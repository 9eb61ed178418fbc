"""The properties that an author states in the descriptions of nodes, where Groot2 shows and keeps them.

    <Fallback name="mapping mission" _description="property seen: always navigation.goto running => perception.lidar_depthmap running;">

A property goes on to the next `;`, `property` or `accepted`, or to the end. It is written as those of models (skillsets/LANGUAGE.md), over
what a mission has: `skillset.resource == STATE`, `skillset.skill running`, `active('node')`, `outcome given_up`, `fault name`.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import replace

from alula.language.errors import Diagnostic
from alula.language.syntax.properties import property_of_mission
from alula.missions.director import Outcome
from alula.model.expressions import MissionIs, ResourceIs, SkillRuns, atoms
from alula.model.model import Property, PropertyKind, Skillset
from alula.model.span import Span
from alula.prove.mission.accepted import DESCRIPTION, NEXT
from alula.trees.document import Attribute
from alula.trees.node import Node

CODE = "ALU713"
PROPERTY = re.compile(rf"\bproperty\s+(?P<text>(?P<name>\w+)\s*:.*?)(?=;|{NEXT})", re.DOTALL)
"""A property in a description; behind it may stand a semicolon."""
ALMOST = re.compile(r"\bproperty\s+(?:(?!never\b|always\b|eventually\b)\w+\s+)?(?:never|always|eventually)\b")
"""Reads like a property, and would be overlooked: the name or the colon behind it is missing."""
OUTCOMES = tuple(one.value for one in Outcome if one is not Outcome.RUNNING)


class WantedError(Exception):
    """A property can't be read; ``finding`` has the place and the remedy."""

    def __init__(self, finding: Diagnostic) -> None:
        super().__init__(finding.message)
        self.finding = finding


def wanted(nodes: Sequence[Node], skillsets: Sequence[Skillset], faults: Collection[str]) -> tuple[list[Property], list[Diagnostic]]:
    """Return the properties in the nodes' descriptions, and a finding for each that can't be read."""
    found: dict[Span, Property] = {}
    wrong: dict[Span, Diagnostic] = {}
    names = {node.name for node in nodes}
    for node in nodes:
        attribute = node.config.element.attributes.get(DESCRIPTION)
        if attribute is None:
            continue
        for almost in ALMOST.finditer(attribute.value):
            span = _span(attribute, almost.start(), Span("", 1, 1, 1 + len(almost[0])))
            wrong.setdefault(span, _wrong(span, "a property has a name and a colon before what it says", HINT))
        for match in PROPERTY.finditer(attribute.value):
            try:
                one = _read(attribute, match["text"], match.start("text"))
                _check(one, attribute, match.start("text"), {skillset.name: skillset for skillset in skillsets}, names, faults)
                found.setdefault(one.span, one)
            except WantedError as error:
                wrong.setdefault(error.finding.span, error.finding)
    for one in found.values():
        twice = next((other for other in found.values() if other.name == one.name and other.span != one.span), None)
        if twice is not None:
            wrong.setdefault(one.span, _wrong(one.span, f"there are two properties `{one.name}`", "give each its own name"))
    return list(found.values()), list(wrong.values())


def _read(attribute: Attribute, text: str, start: int) -> Property:
    one = property_of_mission(text, "the end of the property")
    span = _span(attribute, start, one.span)
    if isinstance(one, Diagnostic):
        raise WantedError(_wrong(span, f"the property can't be read: {one.message}", one.hint or HINT))
    return replace(one, span=span)


HINT = "write `property name: never C`, `always C`, `eventually C`, or `C leads to D`, which may be `within N ticks`"


def _check(
    one: Property, attribute: Attribute, start: int, skillsets: dict[str, Skillset], nodes: Collection[str], faults: Collection[str]
) -> None:
    for condition in (one.condition, one.consequence):
        for atom in () if condition is None else atoms(condition):
            problem = ""
            match atom:
                case ResourceIs(resource=name, state=state):
                    problem = _resource(name, state, skillsets)
                case SkillRuns(skill=name):
                    skillset, _, skill = name.partition(".")
                    problem = _one_of("skill", skill, [s.name for s in skillsets[skillset].skills]) if skillset in skillsets else ""
                    problem = problem or _one_of("skillset", skillset, skillsets)
                case MissionIs(what="active", name=name):
                    problem = _one_of("node", name, nodes)
                case MissionIs(what="outcome", name=name):
                    problem = _one_of("outcome", name, OUTCOMES)
                case MissionIs(what="fault", name=name):
                    problem = _one_of("fault that shows in a state", name, faults)
                    if not problem and (one.kind is not PropertyKind.LEADS_TO or condition is not one.condition):
                        problem = "`fault` is something that happens: it stands before `leads to` only"
            if problem:
                what, _, cure = problem.partition(": ")
                raise WantedError(_wrong(_span(attribute, start, atom.span), f"the property `{one.name}`: {what}", cure))


def _resource(name: str, state: str, skillsets: dict[str, Skillset]) -> str:
    skillset, _, resource = name.partition(".")
    if skillset not in skillsets:
        return _one_of("skillset", skillset, skillsets)
    known = {one.name: one.states for one in skillsets[skillset].resources}
    return _one_of("resource", resource, known) or _one_of("state", state, known[resource], f" of `{name}`")


def _one_of(what: str, name: str, known: Collection[str], where: str = "") -> str:
    if name in known:
        return ""
    return f"there is no {what} `{name}`{where}: there is {', '.join(f'`{one}`' for one in sorted(set(known))) or 'none'}"


def _span(attribute: Attribute, start: int, span: Span) -> Span:
    place = attribute.place_of(start + max(span.column - 1, 0))
    return Span(place.path, place.line, place.column, place.column + max(span.end_column - span.column, 1))


def _wrong(span: Span, message: str, cure: str) -> Diagnostic:
    return Diagnostic(CODE, message, span, hint=cure)
