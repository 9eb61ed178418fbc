"""A skillset without data and without clocks, for the search: what data or time decide may go either way.

A precondition becomes what it asks of resources, if some data fulfil the rest. An invariant over data, or one with
a ``hold``, becomes what it asks at once of resources alone, whatever the data; that data (also the lack of a fresh
value) or time may break it all the same for an execution is a step of its own, a ``Breaker``. A progress deadline ends an
execution as an interruption does, so it adds no step. Every run of the skillset is a run of this one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from alula.language.outside import Arrow
from alula.model.conditions import whatever_the_data
from alula.model.expressions import TRUE, And, Atom, Constant, DataIs, Expression, Implies, Not, Or, ResourceIs, atoms
from alula.model.model import Event, Invariant, Precondition, Skill, Skillset
from alula.prove.limits import Deadline
from alula.prove.skillset.solver import Solver


@dataclass(frozen=True)
class Breaker:
    """Data or time may break this invariant of an execution in every situation that fulfils ``when``."""

    skill: str
    invariant: str
    when: Expression


@dataclass(frozen=True)
class Abstraction:
    """The skillset over resources alone, and what else can happen in it.

    ``births`` tell when an invariant over data may be false right after the start: ``when`` is asked before it. ``original`` is
    the skillset with its data, ``outside`` are the arrows (resource, source, target) that nothing in the model takes.
    """

    skillset: Skillset
    original: Skillset
    solver: Solver
    breakers: tuple[Breaker, ...] = ()
    births: tuple[Breaker, ...] = ()
    outside: frozenset[Arrow] = frozenset()


def without_data(skillset: Skillset, deadline: Deadline, outside: frozenset[Arrow] = frozenset()) -> Abstraction:
    """Return the skillset for the search."""
    solver = Solver(skillset, deadline)
    possibly = _Possibly(solver)
    skills = tuple(_skill(skill, possibly) for skill in skillset.skills)
    events = tuple(_event(event, possibly) for event in skillset.events)
    undecided = [(skill, one) for skill in skillset.skills for one in skill.invariants if not _at_once(one)]
    breakers = [Breaker(skill.name, one.name, Not(whatever_the_data(one.condition, unknown=False))) for skill, one in undecided]
    births = [Breaker(skill.name, one.name, _at_birth(skill, one, possibly)) for skill, one in undecided if not _timed(one)]
    resources = replace(skillset, skills=skills, events=events)
    return Abstraction(resources, skillset, solver, tuple(breakers), tuple(births), outside)


def _timed(invariant: Invariant) -> bool:
    return invariant.hold is not None and invariant.hold.for_s > 0


def _at_birth(skill: Skill, invariant: Invariant, possibly: _Possibly) -> Expression:
    """Return when some data fulfil the preconditions and not the invariant after the start effect."""
    after = {change.resource: change.target for change in skill.start.assignments}
    ready = conjunction(precondition.condition for precondition in skill.preconditions)
    return possibly(And((ready, Not(_replaced(invariant.recovered, lambda atom: _after(atom, after))))))


def _after(atom: Atom, after: Mapping[str, str]) -> Expression:
    if isinstance(atom, ResourceIs) and atom.resource in after:
        return Constant((after[atom.resource] == atom.state) != atom.negated)
    return atom


def _at_once(invariant: Invariant) -> bool:
    return not _timed(invariant) and not any(isinstance(atom, DataIs) for atom in atoms(invariant.condition))


def _skill(skill: Skill, possibly: _Possibly) -> Skill:
    asked = conjunction(precondition.condition for precondition in skill.preconditions)
    preconditions = (Precondition("preconditions", possibly(asked)),) if skill.preconditions else ()
    invariants = tuple(map(_invariant, skill.invariants))
    return replace(skill, preconditions=preconditions, invariants=invariants)


def _invariant(invariant: Invariant) -> Invariant:
    if _at_once(invariant):
        return invariant
    condition = TRUE if _timed(invariant) else whatever_the_data(invariant.condition, unknown=True)
    return replace(invariant, condition=condition, hold=None)


def _event(event: Event, possibly: _Possibly) -> Event:
    return replace(event, guard=possibly(event.guard))


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
    return _replaced(condition, lambda atom: Constant(values[atom]) if isinstance(atom, DataIs) else atom)


def _replaced(condition: Expression, new: Callable[[Atom], Expression]) -> Expression:
    """Return a condition with something else in the place of each atom."""
    match condition:
        case Not(operand=operand):
            return Not(_replaced(operand, new))
        case And(operands=operands):
            return And(tuple(_replaced(operand, new) for operand in operands))
        case Or(operands=operands):
            return Or(tuple(_replaced(operand, new) for operand in operands))
        case Implies(premise=premise, conclusion=conclusion):
            return Implies(_replaced(premise, new), _replaced(conclusion, new))
        case _:
            return new(condition)
