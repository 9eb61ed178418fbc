"""Encodes a skillset's steps as diagrams (see ``diagrams``).

The steps are those of ``alula.model.steps``, as updates of sets; the tests hold them against it. In one thing sets are wider:
executions that one change breaks take effect in any order here, in the order of their start there, so that what is proved for
sets holds, and a counterexample is walked again step by step.
"""

from __future__ import annotations

import itertools
from collections import Counter
from typing import Any

from dd import cudd

from alula.model.expressions import Expression, ResourceIs, atoms
from alula.model.model import Effect, Event, Resource, Skill, Skillset
from alula.model.overapproximation import Breaker
from alula.model.steps import Cause, outcomes_of
from alula.prove.limits import Deadline
from alula.prove.skillset.abstract import Abstraction
from alula.prove.skillset.diagrams import ENDED, Encoded, Update, Within, bits, broken_name, runs_name
from alula.prove.skillset.local import end_key


def encode(abstraction: Abstraction, copies: int, deadline: Deadline) -> Encoded:
    """Return a skillset in diagrams; raise OutOfTimeError."""
    model = _declared(abstraction.skillset, copies)
    for skill in model.skillset.skills:
        deadline.check()
        _marks(model, skill)
    for resource in model.skillset.resources:
        _extern_steps(model, resource, deadline)
    for event in model.skillset.events:
        deadline.check()
        _event_step(model, event)
    for skill in model.skillset.skills:
        deadline.check()
        _starts(model, skill)
        _ends(model, skill)
    for breaker in abstraction.breakers:
        _breaks(model, breaker)
    for birth in abstraction.births:
        model.faults["after start", birth.skill, birth.invariant] |= model.startable[birth.skill] & model.term(birth.when)
    model.steps = _distinct(model)
    return model


def _extern_steps(model: Encoded, resource: Resource, deadline: Deadline) -> None:
    """Add what the functional layer may do to a resource."""
    sources: dict[str, list[str]] = {}
    for transition in resource.transitions:
        if transition.extern and transition.source != transition.target:
            sources.setdefault(transition.target, []).append(transition.source)
    for target, origins in sources.items():
        deadline.check()
        guard = model.any_of(model.is_state(resource.name, source) for source in origins)
        model.steps.append(Update(guard, model.values_of(resource.name, target), (resource.name,)))


def _event_step(model: Encoded, event: Event) -> None:
    if not event.effect.assignments:
        return
    guard, applies = model.term(event.guard), model.applies(event.effect, by_event=True)
    model.faults["effect", "event", event.name] = guard & ~applies
    model.steps.append(Update(guard & applies, model.changes(event.effect), _changed(event.effect)))


def _distinct(model: Encoded) -> list[Update]:
    """Return the steps that can be taken at all, those that do the same once."""
    steps = {(step.guard, tuple(sorted(step.values.items())), step.ends): step for step in model.steps if step.guard != model.bdd.false}
    return list(steps.values())


def _declared(skillset: Skillset, copies: int) -> Encoded:
    """Declare the variables: a skill's beside the resource that it takes, for small diagrams; the one that the fewest others are about."""
    model = Encoded(skillset, cudd.BDD())
    model.bdd.configure(reordering=False)
    about = {skill.name: _about(skill) for skill in skillset.skills}
    wanted = Counter(itertools.chain.from_iterable(about.values()))
    beside = {name: min(sorted(names), key=lambda one: wanted[one], default="") for name, names in about.items()}
    for place in ("", *(resource.name for resource in skillset.resources)):
        model.bdd.declare(*(bits(skillset, place) if place else ()))
        for skill in skillset.skills:
            if beside[skill.name] == place:
                _declare_skill(model, skill, copies)
    model.bdd.declare(ENDED)
    model.copies = {s.name: 1 if _alone(model, s) else copies for s in skillset.skills}
    return model


def _declare_skill(model: Encoded, skill: Skill, copies: int) -> None:
    model.bdd.declare(*(runs_name(skill.name, count) for count in range(1, copies + 1)))
    model.bdd.declare(*(broken_name(skill.name, invariant.name) for invariant in skill.invariants))


def _about(skill: Skill) -> set[str]:
    conditions = [*(p.condition for p in skill.preconditions), *(i.condition for i in skill.invariants)]
    taken = {change.resource for change in skill.start.assignments}
    return taken or {atom.resource for condition in conditions for atom in atoms(condition) if isinstance(atom, ResourceIs)}


def _alone(model: Encoded, skill: Skill) -> bool:
    """Return whether a skill's preconditions and invariants exclude each other: then it runs once at most."""
    ready = model.all_of(model.term(p.condition) for p in skill.preconditions)
    return bool(ready & model.all_of(model.term(i.condition) for i in skill.invariants) == model.bdd.false)


def _marks(model: Encoded, skill: Skill) -> None:
    true_before, running = model.bdd.true, model.bdd.var(runs_name(skill.name, 1))
    for invariant in skill.invariants:
        holds, name = model.term(invariant.condition), broken_name(skill.name, invariant.name)
        model.marks.setdefault(skill.name, []).append((name, running & true_before & ~holds))
        true_before &= holds
        applies = model.applies(invariant.effect)
        if invariant.effect.assignments:
            fault = Within(name, model.bdd.var(name) & running & ~applies, _changed(invariant.effect))
            model.inner["effect", "invariant", skill.name, invariant.name] = fault
        model.violations[name] = [
            Update(update.guard, {**update.values, **({name: False} if last else {})}, update.changed, skill.name)
            for update, last in _ending(model, skill, model.bdd.var(name), invariant.effect, applies)
        ]
        for atom in atoms(invariant.condition):
            if isinstance(atom, ResourceIs) and skill.name not in model.watchers.setdefault(atom.resource, []):
                model.watchers[atom.resource].append(skill.name)


def _ending(model: Encoded, skill: Skill, guard: Any, effect: Effect, applies: Any) -> list[tuple[Update, bool]]:
    """Return the updates that end one execution, with the effect where it applies and without elsewhere; and whether it was the last."""
    updates: list[tuple[Update, bool]] = []
    for count in range(model.copies[skill.name], 0, -1):
        exactly = guard & model.runs(skill.name, count) & ~model.runs(skill.name, count + 1)
        fewer = {runs_name(skill.name, count): False}
        updates.append((Update(exactly & applies, model.changes(effect) | fewer, _changed(effect), skill.name), count == 1))
        updates.append((Update(exactly & ~applies, fewer, (), skill.name), count == 1))
    return updates


def _starts(model: Encoded, skill: Skill) -> None:
    ready, applies = model.all_of(model.term(p.condition) for p in skill.preconditions), model.applies(skill.start)
    most = model.copies[skill.name]
    model.faults["effect", "start", skill.name] = ready & ~applies
    model.startable[skill.name] = ready & applies & ~model.runs(skill.name, most)
    model.crowded[skill.name] = ready & applies & model.runs(skill.name, most)
    for count in range(1, most + 1):
        room = ~model.runs(skill.name, count) & (model.runs(skill.name, count - 1) if count > 1 else model.bdd.true)
        values = model.changes(skill.start) | {runs_name(skill.name, count): True}
        model.steps.append(Update(ready & applies & room, values, _changed(skill.start), touches=skill.name))
    for (name, first_false), invariant in zip(model.marks.get(skill.name, []), skill.invariants, strict=True):
        after = model.bdd.let(model.changes(skill.start) | {runs_name(skill.name, 1): True}, first_false)
        model.faults["after start", skill.name, invariant.name] = model.startable[skill.name] & after
        assert name in model.violations  # noqa: S101 - both are made of the invariants


def _ends(model: Encoded, skill: Skill) -> None:
    running = model.runs(skill.name)
    for end in outcomes_of(skill):
        applies = model.applies(end.effect)
        _end_faults(model, end_key(skill.name, end.name), running, end.effect, applies, end.postcondition)
        # An end whose effect does not apply is a failure, which does what an interruption does.
        guard = running if end.cause is Cause.INTERRUPT else running & applies
        model.steps += [update for update, _ in _ending(model, skill, guard, end.effect, applies)]


def _breaks(model: Encoded, breaker: Breaker) -> None:
    """Data or time end one execution by an invariant."""
    skill = model.skillset.skill(breaker.skill)
    effect = next(one.effect for one in skill.invariants if one.name == breaker.invariant)
    guard, applies = model.runs(skill.name) & model.term(breaker.when), model.applies(effect)
    if effect.assignments:
        model.faults["effect", "invariant", skill.name, breaker.invariant] = guard & ~applies
    model.steps += [update for update, _ in _ending(model, skill, guard, effect, applies)]


def _end_faults(model: Encoded, key: tuple[str, ...], running: Any, effect: Effect, applies: Any, post: Expression) -> None:
    model.faults[("effect", *key)] = running & ~applies
    after = model.bdd.let(model.changes(effect), model.term(post)) if effect.assignments else model.term(post)
    model.faults[("post", *key)] = running & applies & ~after


def _changed(effect: Effect) -> tuple[str, ...]:
    return tuple(change.resource for change in effect.assignments)
