"""Which skills can't run at once: what the one does to a resource excludes what the other needs of it."""

from __future__ import annotations

from collections.abc import Iterator

from alula.model.expressions import And, Expression, Not, ResourceIs
from alula.model.model import Skill


def clash(one: Skill, other: Skill) -> str:
    """Return the resource that keeps two skills of a skillset from running at once, empty where there is none.

    It does when the start of one takes it to a state in which the other can't start, or has to stop; or when what they need of it
    excludes each other.
    """
    return next(iter((*_taken(one, other), *_taken(other, one), *_excluded(one, other))), "")


def _taken(taker: Skill, other: Skill) -> Iterator[str]:
    """Yield the resources that one skill's start takes to a state in which the other can't start, or has to stop."""
    after = {step.resource: step.target for step in taker.start.assignments}
    for condition in (*(one.condition for one in other.preconditions), *(one.condition for one in other.invariants)):
        for atom in _needs(condition):
            if atom.resource in after and (after[atom.resource] == atom.state) == atom.negated:
                yield atom.resource


def _excluded(one: Skill, other: Skill) -> Iterator[str]:
    """Yield resources that both need as long as they run, in two states."""
    needed = {atom.resource: atom.state for each in one.invariants for atom in _needs(each.condition) if not atom.negated}
    for each in other.invariants:
        for atom in _needs(each.condition):
            if atom.resource in needed and (needed[atom.resource] == atom.state) == atom.negated:
                yield atom.resource


def _needs(condition: Expression) -> Iterator[ResourceIs]:
    """Yield the states that a condition can't be true without."""
    match condition:
        case ResourceIs():
            yield condition
        case And(operands=operands):
            for operand in operands:
                yield from _needs(operand)
        case Not(operand=ResourceIs() as atom):
            yield ResourceIs(atom.resource, atom.state, negated=not atom.negated)
