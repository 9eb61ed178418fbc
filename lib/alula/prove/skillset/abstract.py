"""Over-approximate a skillset for its proofs: a solver decides which conditions some data fulfil together.

The preconditions of a skill become what they ask of resources if some data fulfil the rest of all of them at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from alula.language.outside import NamedTransition
from alula.model.deadlines import waits
from alula.model.expressions import TRUE, And, Atom, Constant, DataIs, Expression, Implies, Not, Or, ResourceIs, atoms
from alula.model.model import Invariant, Precondition, Skill, Skillset
from alula.model.overapproximation import Breaker, OverApproximation, at_once, over_approximate
from alula.prove.limits import Deadline
from alula.prove.skillset.solver import Solver


@dataclass(frozen=True)
class Abstraction(OverApproximation):
    """The over-approximation of a skillset, as exact as a solver can tell what some data fulfil.

    ``births`` tell when an invariant over data may be false right after the start: ``when`` is asked before it. ``outside`` are the
    transitions (resource, source, target) that nothing in the model takes.
    """

    solver: Solver
    births: tuple[Breaker, ...] = ()
    outside: frozenset[NamedTransition] = frozenset()


def without_data(skillset: Skillset, deadline: Deadline, outside: frozenset[NamedTransition] = frozenset()) -> Abstraction:
    """Return the skillset for the search; the preconditions of a skill are one."""
    solver = Solver(skillset, deadline)
    possibly = _Possibly(solver)
    model = over_approximate(skillset)
    skills = tuple(
        replace(one, preconditions=_asked(skill, possibly)) for skill, one in zip(skillset.skills, model.skillset.skills, strict=True)
    )
    events = tuple(replace(event, guard=possibly(event.guard)) for event in skillset.events)
    undecided = [(skill, one) for skill in skillset.skills for one in skill.invariants if not at_once(one) and not waits(one)]
    births = tuple(Breaker(skill.name, one.name, _at_birth(skill, one, possibly)) for skill, one in undecided)
    return Abstraction(replace(skillset, skills=skills, events=events), skillset, model.breakers, solver, births, outside)


def _at_birth(skill: Skill, invariant: Invariant, possibly: _Possibly) -> Expression:
    """Return when some data fulfil the preconditions and not the invariant after the start effect."""
    after = {change.resource: change.target for change in skill.start.assignments}
    ready = conjunction(precondition.condition for precondition in skill.preconditions)
    return possibly(And((ready, Not(_replaced(invariant.recovered, lambda atom: _after(atom, after))))))


def _after(atom: Atom, after: Mapping[str, str]) -> Expression:
    if isinstance(atom, ResourceIs) and atom.resource in after:
        return Constant((after[atom.resource] == atom.state) != atom.negated)
    return atom


def _asked(skill: Skill, possibly: _Possibly) -> tuple[Precondition, ...]:
    asked = conjunction(precondition.condition for precondition in skill.preconditions)
    return (Precondition("preconditions", possibly(asked)),) if skill.preconditions else ()


def conjunction(conditions: Iterator[Expression]) -> Expression:
    """Return the conjunction of conditions."""
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
    """Return a condition with each atom replaced."""
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
