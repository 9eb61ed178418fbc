"""Which arrows of resources can break an invariant: what makes a transition of the functional layer a failure."""

from __future__ import annotations

import itertools

from alula.model.conditions import NO_DATA, judge
from alula.model.expressions import ResourceIs, atoms
from alula.model.model import Invariant, Resource, Skillset, Transition


def breaks(skillset: Skillset, resource: Resource, arrow: Transition) -> bool:
    """Tell whether an arrow can make an invariant false that was not."""
    return any(_breaks(skillset, one, resource, arrow) for skill in skillset.skills for one in skill.invariants)


def _breaks(skillset: Skillset, invariant: Invariant, resource: Resource, arrow: Transition) -> bool:
    names = list(dict.fromkeys(atom.resource for atom in atoms(invariant.condition) if isinstance(atom, ResourceIs)))
    if resource.name not in names:
        return False
    others = [name for name in names if name != resource.name]
    for states in itertools.product(*(skillset.resource(name).states for name in others)):
        rest = dict(zip(others, states, strict=True))
        before, after = (judge(invariant.condition, {**rest, resource.name: state}, NO_DATA) for state in (arrow.source, arrow.target))
        if before is not False and after is False:
            return True
    return False
