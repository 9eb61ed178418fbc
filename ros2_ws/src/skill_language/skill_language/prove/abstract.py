"""A skillset without data and without clocks, for the search: what data or time decide may go either way.

A precondition becomes what it asks of resources, if some data fulfil the rest. An invariant over data, or one with
patience (``hold``), becomes what it asks at once of resources alone; that data or time may break it all the same is a
step of its own, a ``Breaker``. Every run of the skillset is a run of this one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from skill_language.model import (
    TRUE,
    And,
    Constant,
    DataIs,
    Event,
    Expression,
    Implies,
    Invariant,
    Not,
    Or,
    Precondition,
    Skill,
    Skillset,
    atoms,
)
from skill_language.prove.limits import Deadline
from skill_language.prove.solver import Solver

FALSE = Constant(value=False)


@dataclass(frozen=True)
class Breaker:
    """Data or time may break this invariant of a skill in every situation that fulfils ``when``."""

    skill: str
    invariant: str
    when: Expression
    broken: Skillset
    """The skillset with the invariant false, for the step in which it breaks."""


@dataclass(frozen=True)
class Abstraction:
    """The skillset over resources alone, and what else can happen in it."""

    skillset: Skillset
    breakers: tuple[Breaker, ...]


def without_data(skillset: Skillset, deadline: Deadline) -> Abstraction:
    """Return the skillset for the search."""
    possibly = _Possibly(Solver(skillset, deadline))
    skills = tuple(_skill(skill, possibly) for skill in skillset.skills)
    events = tuple(_event(event, possibly) for event in skillset.events)
    plain = replace(skillset, skills=skills, events=events)
    breakers: list[Breaker] = []
    for skill in skillset.skills:
        for invariant in skill.invariants:
            if _at_once(invariant):
                continue
            when = possibly(Not(invariant.condition))
            breakers.append(Breaker(skill.name, invariant.name, when, _with_broken(plain, skill.name, invariant.name)))
    return Abstraction(plain, tuple(breakers))


def _at_once(invariant: Invariant) -> bool:
    patient = invariant.hold is not None and invariant.hold.for_s > 0
    return not patient and not any(isinstance(atom, DataIs) for atom in atoms(invariant.condition))


def _skill(skill: Skill, possibly: _Possibly) -> Skill:
    asked = conjunction(precondition.condition for precondition in skill.preconditions)
    preconditions = (Precondition("preconditions", possibly(asked)),) if skill.preconditions else ()
    invariants = tuple(_invariant(invariant, possibly) for invariant in skill.invariants)
    return replace(skill, preconditions=preconditions, invariants=invariants)


def _invariant(invariant: Invariant, possibly: _Possibly) -> Invariant:
    if _at_once(invariant):
        return invariant
    patient = invariant.hold is not None and invariant.hold.for_s > 0
    return replace(invariant, condition=TRUE if patient else possibly(invariant.condition), hold=None)


def _event(event: Event, possibly: _Possibly) -> Event:
    return replace(event, guard=possibly(event.guard))


def _with_broken(plain: Skillset, skill_name: str, invariant_name: str) -> Skillset:
    def broken(invariant: Invariant) -> Invariant:
        return replace(invariant, condition=FALSE) if invariant.name == invariant_name else invariant

    def changed(skill: Skill) -> Skill:
        return replace(skill, invariants=tuple(map(broken, skill.invariants))) if skill.name == skill_name else skill

    return replace(plain, skills=tuple(map(changed, plain.skills)))


def conjunction(conditions: Iterator[Expression]) -> Expression:
    """Return that all conditions are true."""
    several = tuple(conditions)
    if len(several) == 1:
        return several[0]
    return And(several) if several else TRUE


class _Possibly:
    """Replaces a condition by the weakest one over resources that some data fulfil with it."""

    def __init__(self, solver: Solver) -> None:
        self._solver = solver

    def __call__(self, condition: Expression) -> Expression:
        asked = list(dict.fromkeys(atom for atom in atoms(condition) if isinstance(atom, DataIs)))
        if not asked:
            return condition
        cases = [_with_data(condition, values) for values in self._valuations(asked)]
        return Or(tuple(cases)) if len(cases) > 1 else cases[0]

    def _valuations(self, asked: list[DataIs]) -> Iterator[Mapping[DataIs, bool]]:
        """Yield every way in which these atoms can be true and false together; what can't go on is not tried further."""
        terms = [self._solver.term(atom) for atom in asked]

        def grow(chosen: list[bool]) -> Iterator[Mapping[DataIs, bool]]:
            signed = [term if value else self._solver.negation(term) for term, value in zip(terms, chosen, strict=False)]
            if not self._solver.possible(*signed):
                return
            if len(chosen) == len(asked):
                yield dict(zip(asked, chosen, strict=True))
                return
            for value in (True, False):
                yield from grow([*chosen, value])

        yield from grow([])


def _with_data(condition: Expression, values: Mapping[DataIs, bool]) -> Expression:
    match condition:
        case DataIs():
            return Constant(values[condition])
        case Not(operand=operand):
            return Not(_with_data(operand, values))
        case And(operands=operands):
            return And(tuple(_with_data(operand, values) for operand in operands))
        case Or(operands=operands):
            return Or(tuple(_with_data(operand, values) for operand in operands))
        case Implies(premise=premise, conclusion=conclusion):
            return Implies(_with_data(premise, values), _with_data(conclusion, values))
        case _:
            return condition
