"""What effects change: all of their assignments or none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from alula.model.conditions import States
from alula.model.errors import EffectError
from alula.model.model import Effect, Event, Skill, Skillset
from alula.model.situation import Change, Running, Situation
from alula.model.transitions import may_go


def effects_of(skill: Skill) -> Iterator[Effect]:
    """Yield the effects of a skill: of its start, its interruption, its invariants and its results."""
    yield skill.start
    yield skill.interrupt.effect
    yield from (invariant.effect for invariant in skill.invariants)
    yield from (result.effect for result in skill.results)


def effect_changes(skillset: Skillset, execution: Running, effect: Effect, place: str, states: States) -> tuple[Change, ...]:
    """Return what an effect of a skill changes from these states; ``place`` names it where the model does not.

    Every assignment, one after another, must be a transition for skills from the state that its resource is in then; one to that
    very state is possible, too, and changes nothing.

    Raises:
        EffectError: one is neither; then none may be applied.
    """
    name = effect.name or place
    return _changes(skillset, effect, states, f"skill {execution.skill}, effect {name}", f"{execution.skill} {execution.id} {name}")


def event_changes(skillset: Skillset, event: Event, states: States) -> tuple[Change, ...]:
    """Return what an event changes from these states; it may make any transition, extern ones too. Raise EffectError as above."""
    return _changes(skillset, event.effect, states, f"event {event.name}", f"event {event.name}", any_transition=True)


def given_back(skillset: Skillset, execution: Running, states: States) -> tuple[Change, ...]:
    """Return the changes of the interrupt effect if it is possible now, else none: what a failed execution leaves."""
    try:
        return effect_changes(skillset, execution, skillset.skill(execution.skill).interrupt.effect, "failure", states)
    except EffectError:
        return ()


def _changes(
    skillset: Skillset, effect: Effect, states: States, where: str, cause: str, *, any_transition: bool = False
) -> tuple[Change, ...]:
    changes: list[Change] = []
    present = dict(states)
    for assignment in effect.assignments:
        resource, source, target = skillset.resource(assignment.resource), present[assignment.resource], assignment.target
        if not may_go(resource, source, target, any_transition=any_transition):
            whose = "" if any_transition else " for skills"
            raise EffectError(f"{where}: resource {resource.name} is {source} and has no transition {source} -> {target}{whose}")
        if source != target:
            changes.append(Change(resource.name, source, target, cause))
            present[resource.name] = target
    return tuple(changes)


def after(states: States, changes: tuple[Change, ...]) -> Mapping[str, str]:
    """Return the states after the changes."""
    return {**states, **{change.resource: change.target for change in changes}} if changes else states


def without(situation: Situation, execution: Running, states: States) -> Situation:
    """Return the situation with these states and without an execution, and without what is remembered of it."""
    running = tuple(other for other in situation.running if other != execution)
    progressed = {name: since for name, since in situation.progressed.items() if name != execution.id}
    false_since = {key: since for key, since in situation.false_since.items() if key[0] != execution}
    return replace(situation, states=states, running=running, progressed=progressed, false_since=false_since)
