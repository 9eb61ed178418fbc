"""A skillset's steps on sets of situations, as binary decision diagrams (CUDD by way of ``dd``).

A step of this language is a guard and constants: whatever fulfils the guard has these variables set to these values. A
set is moved forwards by forgetting the variables and fixing them, and backwards by putting the constants in; no relation
between old and new variables is ever built. The steps say the same as ``skill_runtime.core.semantics``; the tests hold
them against it. In one thing sets are wider: executions that one change breaks take effect in any order here, in the
order of their start there, so that what is proved for sets holds, and a counterexample is walked again step by step.

Variables: the bits of each resource's state; for each skill ``runs k``: at least k executions run; for each invariant
``broken``: its skill's executions are found broken by it and not yet ended (only within a step).
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from dd import cudd

from skill_language.arrows import origins, targets_of
from skill_language.model import (
    And,
    Constant,
    Effect,
    Expression,
    Implies,
    Not,
    Or,
    ResourceIs,
    Skill,
    SkillRuns,
    Skillset,
    atoms,
)
from skill_language.prove.abstract import Abstraction, Breaker

ENDED = "ended"
"""A variable to tell, where it matters, the steps that end a certain skill."""


@dataclass(frozen=True)
class Update:
    """What fulfils ``guard`` gets these values; ``changed`` are the resources among them, ``ends`` the skill that it ends."""

    guard: Any
    values: Mapping[str, bool]
    changed: tuple[str, ...] = ()
    ends: str = ""
    touches: str = ""
    """The skill that it starts or finds broken."""


@dataclass(frozen=True)
class Cluster:
    """Skills whose violations touch what another of them needs; those of different clusters take effect in any order alike."""

    skills: tuple[str, ...]
    broken: tuple[str, ...]
    idle: Any
    """None of its executions is found broken."""


@dataclass
class Encoded:
    """A skillset in diagrams: its steps, its marks (which invariant breaks first) and violations, and what can go wrong."""

    skillset: Skillset
    bdd: Any
    copies: Mapping[str, int] = field(default_factory=dict)
    steps: list[Update] = field(default_factory=list)
    marks: dict[str, list[tuple[str, Any]]] = field(default_factory=dict)
    """For each skill: the variable ``broken`` and the situations in which this invariant is its first false one."""
    violations: dict[str, list[Update]] = field(default_factory=dict)
    """For each variable ``broken``: what ends one execution."""
    watchers: dict[str, list[str]] = field(default_factory=dict)
    """For each resource the skills with an invariant about it."""
    faults: dict[tuple[str, ...], Any] = field(default_factory=dict)
    """Situations that show a fault before the step; those of ``inner`` show it within one."""
    inner: dict[tuple[str, ...], Any] = field(default_factory=dict)
    startable: dict[str, Any] = field(default_factory=dict)
    crowded: dict[str, Any] = field(default_factory=dict)
    clusters: list[Cluster] = field(default_factory=list)
    idle: Any = None
    """No execution is found broken: the step is over."""

    # --- terms ----------------------------------------------------------------------------------------------------

    def values_of(self, resource: str, state: str) -> dict[str, bool]:
        """Return the bits of a state."""
        number = self.skillset.resource(resource).states.index(state)
        return {name: bool(number >> bit & 1) for bit, name in enumerate(bits(self.skillset, resource))}

    def is_state(self, resource: str, state: str) -> Any:
        """Return the situations with a resource in a state."""
        if state not in self.skillset.resource(resource).states:
            return self.bdd.false
        return self.bdd.cube(self.values_of(resource, state))

    def runs(self, skill: str, count: int = 1) -> Any:
        """Return the situations in which at least so many executions of a skill run."""
        return self.bdd.var(runs_name(skill, count)) if count <= self.copies[skill] else self.bdd.false

    def term(self, condition: Expression) -> Any:
        """Return the situations that fulfil a condition over resources and executions."""
        match condition:
            case ResourceIs(resource=resource, state=state, negated=negated):
                same = self.is_state(resource, state)
                return ~same if negated else same
            case SkillRuns(skill=skill):
                return self.runs(skill)
            case Constant(value=value):
                return self.bdd.true if value else self.bdd.false
            case Not(operand=operand):
                return ~self.term(operand)
            case And(operands=operands):
                return self.all_of(self.term(operand) for operand in operands)
            case Or(operands=operands):
                return self.any_of(self.term(operand) for operand in operands)
            case Implies(premise=premise, conclusion=conclusion):
                return ~self.term(premise) | self.term(conclusion)
            case _:
                raise ValueError(f"no set of situations can ask data: {condition}")

    def all_of(self, terms: Iterable[Any]) -> Any:
        """Return what is in all sets."""
        result = self.bdd.true
        for term in terms:
            result &= term
        return result

    def any_of(self, terms: Iterable[Any]) -> Any:
        """Return what is in some set."""
        result = self.bdd.false
        for term in terms:
            result |= term
        return result

    def applies(self, effect: Effect, *, by_event: bool = False) -> Any:
        """Return the situations in which every change of an effect is possible."""
        return self.all_of(
            self.any_of(self.is_state(name, source) for source in origins(self.skillset.resource(name), targets, any_arrow=by_event))
            for name, targets in targets_of(effect).items()
        )

    def changes(self, effect: Effect) -> dict[str, bool]:
        """Return what an effect sets."""
        values: dict[str, bool] = {}
        for change in effect.assignments:
            if change.target in self.skillset.resource(change.resource).states:
                values |= self.values_of(change.resource, change.target)
        return values


def bits(skillset: Skillset, resource: str) -> list[str]:
    """Return the variables of a resource."""
    count = max(1, (len(skillset.resource(resource).states) - 1).bit_length())
    return [f"resource {resource} {bit}" for bit in range(count)]


def runs_name(skill: str, count: int) -> str:
    """Return the variable that tells that at least ``count`` executions run."""
    return f"runs {skill} {count}"


def broken_name(skill: str, invariant: str) -> str:
    """Return the variable that tells that an invariant was found false and its executions are yet to end."""
    return f"broken {skill} {invariant}"


# --- encoding ---------------------------------------------------------------------------------------------------------


def encode(abstraction: Abstraction, copies: int) -> Encoded:
    """Return a skillset in diagrams."""
    model = _declared(abstraction.skillset, copies)
    for skill in model.skillset.skills:
        _marks(model, skill)
    for resource in model.skillset.resources:
        for target in dict.fromkeys(arrow.target for arrow in resource.transitions if arrow.extern):
            origins = [a.source for a in resource.transitions if a.extern and a.target == target and a.source != target]
            guard = model.any_of(model.is_state(resource.name, source) for source in origins)
            model.steps.append(Update(guard, model.values_of(resource.name, target), (resource.name,)))
    for event in model.skillset.events:
        guard, applies = model.term(event.guard), model.applies(event.effect, by_event=True)
        if event.effect.assignments:
            model.faults["effect", "event", event.name] = guard & ~applies
            model.steps.append(Update(guard & applies, model.changes(event.effect), _changed(event.effect)))
    for skill in model.skillset.skills:
        _starts(model, skill)
        _ends(model, skill)
    for breaker in abstraction.breakers:
        _breaks(model, breaker)
    for birth in abstraction.births:
        model.faults["after start", birth.skill, birth.invariant] |= model.startable[birth.skill] & model.term(birth.when)
    model.steps = _distinct(model)
    model.clusters = [_cluster(model, skills) for skills in _entangled(model.skillset)]
    model.idle = model.all_of(cluster.idle for cluster in model.clusters)
    return model


def _distinct(model: Encoded) -> list[Update]:
    """Return the steps that can be taken at all, those that do the same once."""
    steps = {(step.guard, tuple(sorted(step.values.items())), step.ends): step for step in model.steps if step.guard != model.bdd.false}
    return list(steps.values())


def _cluster(model: Encoded, skills: Sequence[Skill]) -> Cluster:
    broken = tuple(broken_name(skill.name, invariant.name) for skill in skills for invariant in skill.invariants)
    idle = model.all_of(~model.bdd.var(name) for name in broken)
    return Cluster(tuple(skill.name for skill in skills), broken, idle)


def _entangled(skillset: Skillset) -> list[list[Skill]]:
    """Return groups of skills with invariants: two are together when what one's violations write concerns the other."""
    groups: list[tuple[list[Skill], set[str], set[str]]] = []
    for skill in skillset.skills:
        if not skill.invariants:
            continue
        writes = {change.resource for invariant in skill.invariants for change in invariant.effect.assignments}
        asked = [atom for invariant in skill.invariants for atom in atoms(invariant.condition)]
        concerns = writes | {atom.resource for atom in asked if isinstance(atom, ResourceIs)}
        joined, apart = [skill], []
        for others, written, concerned in groups:
            if writes & concerned or written & concerns:
                joined, writes, concerns = [*others, *joined], writes | written, concerns | concerned
            else:
                apart.append((others, written, concerned))
        groups = [*apart, (joined, writes, concerns)]
    return [group for group, _, _ in groups]


def _declared(skillset: Skillset, copies: int) -> Encoded:
    """Declare the variables: a skill's beside the resource that the fewest others are about, for small diagrams."""
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
    names = {atom.resource for condition in conditions for atom in atoms(condition) if isinstance(atom, ResourceIs)}
    return names | {change.resource for change in skill.start.assignments}


def _alone(model: Encoded, skill: Skill) -> bool:
    """Tell whether a skill's preconditions and invariants exclude each other: then it runs once at most."""
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
            model.inner["effect", "invariant", skill.name, invariant.name] = model.bdd.var(name) & running & ~applies
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
    running, stop = model.runs(skill.name), skill.interrupt
    stops = model.applies(stop.effect)
    key: tuple[str, ...] = ("interrupt", skill.name)
    _end_faults(model, key, running, stop.effect, stops, stop.postcondition)
    model.steps += [update for update, _ in _ending(model, skill, running, stop.effect, stops)]
    # An end whose effect does not apply is a failure, which does what an interruption does: that step is there already.
    for result in skill.results:
        applies = model.applies(result.effect)
        _end_faults(model, ("result", skill.name, result.name), running, result.effect, applies, result.postcondition)
        model.steps += [update for update, _ in _ending(model, skill, running & applies, result.effect, applies)]


def _breaks(model: Encoded, breaker: Breaker) -> None:
    """Data or time end one execution by an invariant."""
    skill = model.skillset.skill(breaker.skill)
    effect = next(one.effect for one in skill.invariants if one.name == breaker.invariant)
    guard, applies = model.runs(skill.name) & model.term(breaker.when), model.applies(effect)
    if effect.assignments:
        model.faults["effect", "invariant", skill.name, breaker.invariant] = guard & ~applies
    model.steps += [update for update, _ in _ending(model, skill, guard, effect, applies)]


def _end_faults(model: Encoded, key: tuple[str, ...], running: Any, effect: Effect, applies: Any, post: Expression) -> None:
    model.faults["effect", *key] = running & ~applies
    after = model.bdd.let(model.changes(effect), model.term(post)) if effect.assignments else model.term(post)
    model.faults["post", *key] = running & applies & ~after


def _changed(effect: Effect) -> tuple[str, ...]:
    return tuple(change.resource for change in effect.assignments)
