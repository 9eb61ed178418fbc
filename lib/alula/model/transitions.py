"""From where an effect is possible: each of its changes, one after another, must be a transition or leave its resource where it is."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from alula.model.model import Effect, Resource


def may_go(resource: Resource, source: str, target: str, *, any_transition: bool) -> bool:
    """Return whether a skill (or with ``any_transition`` an event) may have a resource go from source to target; staying is no change."""
    if source == target or resource.has_transition(source, target, extern=False):
        return True
    return any_transition and resource.has_transition(source, target, extern=True)


def targets_of(effect: Effect) -> dict[str, list[str]]:
    """Return for each resource of an effect the states that it is put in, one after another."""
    targets: dict[str, list[str]] = {}
    for assignment in effect.assignments:
        targets.setdefault(assignment.resource, []).append(assignment.target)
    return targets


def origins(resource: Resource, targets: Sequence[str], *, any_transition: bool) -> list[str]:
    """Return the states from which a resource may go to these targets, one after another."""
    return [state for state in resource.states if _all_the_way(resource, state, targets, any_transition=any_transition)]


def _all_the_way(resource: Resource, state: str, targets: Sequence[str], *, any_transition: bool) -> bool:
    stations = [state, *targets]
    return all(may_go(resource, a, b, any_transition=any_transition) for a, b in pairwise(stations))
