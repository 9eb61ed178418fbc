"""Ways to alter a model, each at each place where it can be done: a skillset with one alteration in it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

from alula.model.expressions import Expression, Not, ResourceIs
from alula.model.model import Effect, Skill, Skillset
from mission_mutations.trees import CONDITION_NEGATED

INVARIANT_WEAKENED = "an invariant weakened"
EFFECT_FORGOTTEN = "an effect forgotten"

Item = TypeVar("Item")
Altered = tuple[str, str, Skill]
"""The kind of an alteration, what it does, and the skill."""


def altered(skillset: Skillset, used: Collection[str]) -> Iterator[tuple[str, str, Skillset]]:
    """Yield each altered skillset: kind, what was done to which skill, and the model. Only ``used`` skills are altered."""
    for at, skill in enumerate(skillset.skills):
        for kind, what, mutant in _skill(skill) if skill.name in used else ():
            skills = _put(skillset.skills, at, replace(mutant, effects=_used(mutant)))
            yield kind, f"{skillset.name}.{skill.name}: {what}", replace(skillset, skills=skills)


def _used(skill: Skill) -> tuple[Effect, ...]:
    """Return the named effects that are used: that one is not would say what was done."""
    uses = [skill.start, skill.interrupt.effect, *(one.effect for one in skill.invariants), *(one.effect for one in skill.results)]
    return tuple(one for one in skill.effects if one in uses)


def _skill(skill: Skill) -> Iterator[Altered]:
    yield from _effects(skill)
    for at, one in enumerate(skill.invariants):
        left = (*skill.invariants[:at], *skill.invariants[at + 1 :])
        yield INVARIANT_WEAKENED, f"without its invariant `{one.name}`", replace(skill, invariants=left)
        negated = replace(one, condition=_negated(one.condition))
        yield CONDITION_NEGATED, f"its invariant `{one.name}` is negated", replace(skill, invariants=_put(skill.invariants, at, negated))
    for at, need in enumerate(skill.preconditions):
        other = replace(need, condition=_negated(need.condition))
        yield (
            CONDITION_NEGATED,
            f"its precondition `{need.name}` is negated",
            replace(skill, preconditions=_put(skill.preconditions, at, other)),
        )


def _effects(skill: Skill) -> Iterator[Altered]:
    for left, resource in _less(skill.start):
        yield EFFECT_FORGOTTEN, f"its start forgets {resource}", replace(skill, start=left)
    for left, resource in _less(skill.interrupt.effect):
        yield EFFECT_FORGOTTEN, f"its interruption forgets {resource}", replace(skill, interrupt=replace(skill.interrupt, effect=left))
    for at, one in enumerate(skill.invariants):
        for left, resource in _less(one.effect):
            invariants = _put(skill.invariants, at, replace(one, effect=left))
            yield EFFECT_FORGOTTEN, f"its broken invariant `{one.name}` forgets {resource}", replace(skill, invariants=invariants)
    for at, result in enumerate(skill.results):
        for left, resource in _less(result.effect):
            results = _put(skill.results, at, replace(result, effect=left))
            yield EFFECT_FORGOTTEN, f"its result {result.name} forgets {resource}", replace(skill, results=results)


def _less(effect: Effect) -> Iterator[tuple[Effect, str]]:
    """Yield the effect without each of its assignments, and the resource of that."""
    for at, one in enumerate(effect.assignments):
        yield Effect(assignments=(*effect.assignments[:at], *effect.assignments[at + 1 :])), one.resource


def _negated(condition: Expression) -> Expression:
    return replace(condition, negated=not condition.negated) if isinstance(condition, ResourceIs) else Not(condition)


def _put(items: Sequence[Item], at: int, item: Item) -> tuple[Item, ...]:
    return (*items[:at], item, *items[at + 1 :])
