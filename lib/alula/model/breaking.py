"""Which transitions of resources can break an invariant: what makes a transition of the functional layer a failure."""

from __future__ import annotations

import itertools

from alula.model.conditions import NO_DATA, judge
from alula.model.expressions import Expression, ResourceIs, atoms
from alula.model.model import Resource, Skillset, Transition


def breaks(skillset: Skillset, resource: Resource, transition: Transition) -> bool:
    """Return whether a transition can make an invariant false that was not."""
    return any(can_break(skillset, one.condition, resource, transition) for skill in skillset.skills for one in skill.invariants)


def can_break(skillset: Skillset, condition: Expression, resource: Resource, transition: Transition) -> bool:
    """Return whether a transition can make a condition false that was not."""
    names = list(dict.fromkeys(atom.resource for atom in atoms(condition) if isinstance(atom, ResourceIs)))
    if resource.name not in names:
        return False
    others = [name for name in names if name != resource.name]
    for states in itertools.product(*(skillset.resource(name).states for name in others)):
        rest = dict(zip(others, states, strict=True))
        before, after = (judge(condition, {**rest, resource.name: state}, NO_DATA) for state in (transition.source, transition.target))
        if before is not False and after is False:
            return True
    return False
