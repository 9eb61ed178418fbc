"""Search counterexamples of properties among runs of a few skills, where all skills together have too many situations.

A run in which only some skills are ever asked for is a run of the whole skillset, so what it shows against a property stands. The skills
around a property come first: those that it names, and those that change the resources that it names; then, again and again, those that
change what these ask for. A situation in which nothing of the part can happen is an end of a run only if nothing at all can.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from alula.language.errors import Diagnostic
from alula.model.effects import effects_of
from alula.model.expressions import Expression, ResourceIs, SkillRuns, atoms
from alula.model.model import Effect, Property, Skill, Skillset
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.skillset.abstract import Abstraction
from alula.prove.skillset.explore import Graph, explore
from alula.prove.skillset.properties import check_property
from alula.prove.skillset.steps import Part, TransitionSystem

MOST = 3000
"""Situations that are looked at with each number of skills."""


def refuted(abstraction: Abstraction, properties: Iterable[Property], deadline: Deadline, *, copies: int) -> dict[str, Diagnostic]:
    """Return a finding for each property, by name, that some run of a few skills violates; the others remain undecided."""
    whole = TransitionSystem(abstraction, copies=copies)
    found: dict[str, Diagnostic] = {}
    for wanted in properties:
        try:
            for part in parts_around(abstraction.skillset, wanted):
                graph = explore(TransitionSystem(abstraction, copies=copies, part=part), deadline, most=MOST)
                finding = check_property(graph, wanted, _unknown(graph, whole))
                if finding is not None:
                    found[wanted.name] = finding
                if finding is not None or not graph.complete:
                    break
        except OutOfTimeError:
            break
    return found


def _unknown(graph: Graph, whole: TransitionSystem) -> set[int]:
    """Return the situations without a step, which are no ends of runs of the whole skillset."""
    without = [number for number, edges in enumerate(graph.edges) if not edges]
    return {n for n in without if any(move.step is not None and move.target != graph.states[n] for move in whole.moves(graph.states[n]))}


def parts_around(skillset: Skillset, wanted: Property) -> Iterator[Part]:
    """Yield parts of a skillset around a property, each larger than the one before."""
    asked = [wanted.condition, *([wanted.consequence] if wanted.consequence is not None else [])]
    resources = {name for condition in asked for name in _resources(condition)}
    skills = {atom.skill for condition in asked for atom in atoms(condition) if isinstance(atom, SkillRuns)}
    before: Part | None = None
    while True:
        skills |= {skill.name for skill in skillset.skills if resources & _changed(effects_of(skill))}
        events = {event.name for event in skillset.events if resources & _changed([event.effect])}
        part = Part(frozenset(skills), frozenset(resources), frozenset(events))
        if part == before:
            return
        yield part
        before = part
        resources |= {name for skill in skillset.skills if skill.name in skills for name in _asked_by(skill)}
        resources |= {name for event in skillset.events if event.name in events for name in _resources(event.guard)}


def _changed(effects: Iterable[Effect]) -> set[str]:
    return {change.resource for effect in effects for change in effect.assignments}


def _resources(condition: Expression) -> set[str]:
    return {atom.resource for atom in atoms(condition) if isinstance(atom, ResourceIs)}


def _asked_by(skill: Skill) -> set[str]:
    """Return the resources that let a skill start, go on and change something."""
    conditions = [*(one.condition for one in skill.preconditions), *(one.condition for one in skill.invariants)]
    return _changed(effects_of(skill)).union(*map(_resources, conditions))
