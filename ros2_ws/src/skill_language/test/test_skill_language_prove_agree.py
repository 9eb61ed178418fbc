"""Two ways to each answer: sets against single situations, checker against runtime, z3 against trying all states."""

from __future__ import annotations

import itertools

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from skill_language_prove_models import skillsets

from skill_language.model import TRUE
from skill_language.prove.abstract import without_data
from skill_language.prove.bdd_model import encode
from skill_language.prove.explicit import search as one_by_one
from skill_language.prove.explore import explore
from skill_language.prove.limits import Deadline
from skill_language.prove.local import local_checks
from skill_language.prove.sets import Sets
from skill_language.prove.steps import World
from skill_language.prove.symbolic import search as by_sets
from skill_runtime.core import SkillsetEngine
from skill_runtime.core.conditions import holds
from skill_runtime.hooks import SkillHooks

ANY_TIME = Deadline.after(3600.0)
MOST = 60
QUIET = {"deadline": None, "suppress_health_check": list(HealthCheck)}


def order_is_irrelevant(skillset):
    """At most one skill's violations change anything, and no two executions of it can run at once."""
    return sum(any(i.effect.assignments for i in skill.invariants) for skill in skillset.skills) <= 1


def graph_of(skillset):
    return explore(World(without_data(skillset, ANY_TIME)), ANY_TIME, most=MOST)


@settings(max_examples=60, **QUIET)
@given(skillsets(most_resources=2))
def test_sets_hold_every_situation_and_where_no_order_matters_no_other(skillset):
    graph = graph_of(skillset)
    if not graph.complete:
        return
    sets = Sets(encode(without_data(skillset, ANY_TIME), 2), ANY_TIME)
    for state in graph.states:
        assert sets.contains(sets.reached, state)
    if order_is_irrelevant(skillset):
        assert sets.count() == len({(state.resources, tuple(sorted(state.running))) for state in graph.states})


@settings(max_examples=60, **QUIET)
@given(skillsets(properties=True, most_resources=2))
def test_both_searches_find_the_same(skillset):
    _certain, suspects = local_checks(skillset, ANY_TIME)
    plain = without_data(skillset, ANY_TIME)
    first = one_by_one(skillset, plain, suspects, ANY_TIME, most=MOST, copies=2)
    if first is None:
        return
    second = by_sets(skillset, plain, suspects, ANY_TIME, copies=2)
    if order_is_irrelevant(skillset):
        assert found(first) == found(second)
    else:
        # Sets are wider: what they prove holds, and what they refute was walked.
        assert {f for f in found(second) if f[0] != "ALU540"} <= found(first)
        undecided = {f[1].split("`")[1] for f in found(second) if f[0] == "ALU540"}
        refuted = {f[1].split("`")[1] for f in found(first) if f[0] == "ALU531"}
        assert refuted <= undecided | {f[1].split("`")[1] for f in found(second) if f[0] == "ALU531"}


def found(findings):
    # Which skills share a story of being lost, and which situation refutes a property, are matters of luck.
    return {(f.code, f.message.split(":")[0] if f.code == "ALU531" else f.message, f.severity) for f in findings if f.code != "ALU524"} | {
        ("ALU524", name, f.severity) for f in findings if f.code == "ALU524" for name in f.message.split("`")[1::2]
    }


# --- the runtime ------------------------------------------------------------------------------------------------------


def engine_of(skillset):
    hooks = {skill.name: SkillHooks() for skill in skillset.skills}
    return SkillsetEngine(skillset, lambda: 0, hooks, lambda _events: None)


def state_of(world, engine):
    resources = tuple(engine.resources[resource.name].state for resource in world.skillset.resources)
    return resources, tuple(sorted(execution.skill for execution in engine.executions))


@settings(max_examples=60, **QUIET)
@given(skillsets(most_resources=2, events=False), st.data())
def test_the_runtime_goes_where_the_checker_says_and_nowhere_else(skillset, data):
    graph = graph_of(skillset)
    engine = engine_of(skillset)
    if not graph.complete:
        return
    numbers = {0}
    for _ in range(12):
        stimulus = data.draw(st.sampled_from(stimuli(skillset, engine, graph.world.copies)))
        before = state_of(graph.world, engine)
        give(engine, stimulus)
        after = state_of(graph.world, engine)
        if after == before:
            continue
        kinds = {"fail": "interrupt"}.get(stimulus[0], stimulus[0])
        ways = [e for n in numbers for e in graph.edges[n] if e.kind in {kinds, "interrupt"} and e.subject[0] == stimulus[1]]
        numbers = {e.target for e in ways if plain(graph.states[e.target]) == after}
        assert numbers, (stimulus, before, after)


@settings(max_examples=60, **QUIET)
@given(skillsets(most_resources=2, events=False))
def test_every_step_of_the_checker_can_be_taken_in_the_runtime(skillset):
    graph = graph_of(skillset)
    for number in range(min(len(graph.states), 12)):
        engine = engine_of(skillset)
        for edge in graph.path(number):
            follow(engine, edge)
        assert state_of(graph.world, engine) == plain(graph.states[number])


def plain(state):
    return state.resources, tuple(sorted(state.running))


def stimuli(skillset, engine, copies):
    running = [execution.skill for execution in engine.executions]
    given = [("extern", r.name, state) for r in skillset.resources for state in r.states]
    given += [("start", skill.name) for skill in skillset.skills if running.count(skill.name) < copies]
    for execution in engine.executions:
        results = skillset.skill(execution.skill).results
        given += [("terminate", execution.skill, execution.id, result.name) for result in results]
        given += [("interrupt", execution.skill, execution.id), ("fail", execution.skill, execution.id)]
    return given


def give(engine, stimulus):
    match stimulus:
        case ("extern", resource, state):
            engine.transition(resource, state)
        case ("start", skill):
            engine.request(skill, {})
        case ("terminate", _, execution, result):
            engine.terminate(execution, result)
        case ("interrupt", _, execution):
            engine.interrupt(execution)
        case ("fail", _, execution):
            engine.fail(execution, "asked to")


def follow(engine, edge):
    """Take a step of the checker; of several executions of a skill any one: these tests compare what is left of all."""
    oldest = next((e.id for e in engine.executions if e.skill == edge.subject[0]), "")
    match edge.kind:
        case "extern":
            give(engine, ("extern", *edge.subject))
        case "start":
            give(engine, ("start", *edge.subject))
        case "terminate":
            give(engine, ("terminate", edge.subject[0], oldest, edge.subject[1]))
        case _:
            give(engine, ("interrupt", edge.subject[0], oldest))


# --- z3 ---------------------------------------------------------------------------------------------------------------


@settings(max_examples=80, **QUIET)
@given(skillsets())
def test_local_checks_say_what_trying_every_state_says(skillset):
    certain, suspects = local_checks(skillset, ANY_TIME)
    for skill in skillset.skills:
        keys = {s.key for s in suspects}
        ready = [s for s in every_state(skillset) if all(holds(p.condition, s, {}) for p in skill.preconditions)]
        kept = [s for s in every_state(skillset) if all(holds(i.condition, s, {}) for i in skill.invariants)]
        assert (("effect", "start", skill.name) in keys) == any(not fits(skillset, skill.start, s) for s in ready)
        assert (("effect", "interrupt", skill.name) in keys) == any(not fits(skillset, skill.interrupt.effect, s) for s in kept)
        for result in skill.results:
            key = ("result", skill.name, result.name)
            assert (("effect", *key) in keys) == any(not fits(skillset, result.effect, s) for s in kept)
            bad = [s for s in kept if fits(skillset, result.effect, s) and not holds(result.postcondition, after(result.effect, s), {})]
            assert (("post", *key) in keys) == bool(bad)
        before = list(every_state(skillset))
        for precondition in skill.preconditions:
            messages = {f.code for f in certain if f"precondition `{precondition.name}` of `{skill.name}`" in f.message}
            here = [s for s in before if holds(precondition.condition, s, {})]
            assert ("ALU504" in messages) == (bool(before) and not here)
            # The test's models have no places: a `true` of theirs is taken for one that nobody wrote.
            assert ("ALU505" in messages) == (bool(here) and len(here) == len(before) and precondition.condition != TRUE)
            before = here
        for index, invariant in enumerate(skill.invariants):
            begun = [after(skill.start, s) for s in ready if fits(skillset, skill.start, s)]
            begun = [s for s in begun if all(holds(i.condition, s, {}) for i in skill.invariants[:index])]
            expected = any(not holds(invariant.condition, s, {}) for s in begun)
            assert (("after start", skill.name, invariant.name) in keys) == expected
            others = [i for i in skill.invariants if i is not invariant]
            broken = [s for s in every_state(skillset) if not holds(invariant.condition, s, {})]
            broken = [s for s in broken if all(holds(i.condition, s, {}) for i in others)]
            assert (("effect", "invariant", skill.name, invariant.name) in keys) == any(
                not fits(skillset, invariant.effect, s) for s in broken
            )


def every_state(skillset):
    names = [resource.name for resource in skillset.resources]
    for states in itertools.product(*(resource.states for resource in skillset.resources)):
        yield dict(zip(names, states, strict=True))


def fits(skillset, effect, states):
    return all(skillset.resource(a.resource).has_arrow(states[a.resource], a.target, extern=False) for a in effect.assignments)


def after(effect, states):
    return {**states, **{change.resource: change.target for change in effect.assignments}}
