"""Two ways to each answer: sets against single situations, checker against runtime, z3 against trying all states."""

from __future__ import annotations

import itertools
import random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from prove_models import VALUES, skillsets, sparse_skillsets

from alula.language.counterexamples import StepKind
from alula.model import semantics
from alula.model.conditions import holds
from alula.model.expressions import TRUE, ResourceIs
from alula.model.model import Invariant, Property, PropertyKind, Resource, Result, Skill, Skillset, Transition
from alula.prove.limits import Deadline
from alula.prove.skillset import sets as sets_module
from alula.prove.skillset.abstract import without_data
from alula.prove.skillset.encoding import encode
from alula.prove.skillset.explicit import search as one_by_one
from alula.prove.skillset.explore import explore
from alula.prove.skillset.local import local_checks
from alula.prove.skillset.sets import Sets
from alula.prove.skillset.steps import TransitionSystem
from alula.prove.skillset.symbolic import search as by_sets
from alula.runtime.core import SkillsetEngine
from alula.runtime.hooks import SkillHooks

pytestmark = pytest.mark.long
ANY_TIME = Deadline.after(1e6)
MOST = 60
QUIET = {"deadline": None, "suppress_health_check": list(HealthCheck)}


def order_is_irrelevant(skillset):
    """At most one skill's violations change anything, and no two executions of it can run at once."""
    return sum(any(i.effect.assignments for i in skill.invariants) for skill in skillset.skills) <= 1


def graph_of(skillset):
    return explore(TransitionSystem(without_data(skillset, ANY_TIME)), ANY_TIME, most=MOST)


@settings(max_examples=60, **QUIET)
@given(skillsets(most_resources=2) | skillsets(most_resources=2, timed=True))
def test_sets_hold_every_situation_and_where_no_order_matters_no_other(skillset):
    graph = graph_of(skillset)
    if not graph.complete:
        return
    sets = Sets(encode(without_data(skillset, ANY_TIME), 2, ANY_TIME), ANY_TIME)
    for state in graph.states:
        assert sets.contains(sets.reached, state)
    if order_is_irrelevant(skillset):
        assert sets.count() == len({(state.resources, tuple(sorted(state.running))) for state in graph.states})


@settings(max_examples=60, **QUIET)
@given(skillsets(properties=True, most_resources=2) | skillsets(properties=True, most_resources=2, timed=True))
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


@settings(max_examples=80, **QUIET)
@given(sparse_skillsets() | skillsets(properties=True, most_resources=2) | skillsets(properties=True, most_resources=2, timed=True))
def test_a_bound_of_what_can_be_reached_finds_the_same_as_all_that_can_be(skillset):
    """Where sets are too large: the same findings, with the same counterexamples; and the bound has every situation."""
    _certain, suspects = local_checks(skillset, ANY_TIME)
    exactly = by_sets(skillset, without_data(skillset, ANY_TIME), suspects, ANY_TIME, copies=2)
    plain = without_data(skillset, ANY_TIME)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sets_module, "MOST_NODES", 0)
        sets = Sets(encode(plain, 2, ANY_TIME), ANY_TIME)
        assert by_sets(skillset, plain, suspects, ANY_TIME, copies=2) == exactly
    if not sets.exact:
        for number, state in enumerate(explore(TransitionSystem(plain), ANY_TIME, most=MOST).states):
            assert sets.contains(sets.narrowed(sets.reached), state), number


@settings(max_examples=40, **QUIET)
@given(sparse_skillsets())
def test_sparse_models_are_found_alike_one_by_one_and_as_sets(skillset):
    _certain, suspects = local_checks(skillset, ANY_TIME)
    plain = without_data(skillset, ANY_TIME)
    first = one_by_one(skillset, plain, suspects, ANY_TIME, most=3000, copies=2)
    if first is None:
        return
    for most in (sets_module.MOST_NODES, 0):
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(sets_module, "MOST_NODES", most)
            second = by_sets(skillset, plain, suspects, ANY_TIME, copies=2)
        assert found(first) == found(second)
        assert lengths(first) == lengths(second)


@pytest.mark.parametrize("most", [sets_module.MOST_NODES, 0])
def test_a_suspicion_that_no_run_confirms_is_given_up(most, monkeypatch):
    """A skill that is broken as it starts takes a step back to where it began: sets suspect a run, and no run is one."""
    monkeypatch.setattr(sets_module, "MOST_NODES", most)
    switch = Resource("r", ("A", "B"), "A", (Transition("A", "B", extern=True),))
    broken = Skill("f", invariants=(Invariant("i", ResourceIs("r", "B")),), results=(Result("OK"),))
    comes = Property("w", PropertyKind.EVENTUALLY, ResourceIs("r", "B"), fair=True)
    skillset = Skillset("s", resources=(switch,), skills=(broken,), properties=(comes,))
    deadline = Deadline.after(60.0)
    _certain, suspects = local_checks(skillset, deadline)
    first = one_by_one(skillset, without_data(skillset, deadline), suspects, deadline, most=MOST, copies=2)
    assert found(by_sets(skillset, without_data(skillset, deadline), suspects, deadline, copies=2)) == found(first)


def lengths(findings):
    """Return how long each counterexample is that has to be a shortest one."""
    return {
        (f.code, f.message.split(":")[0]): len(f.counterexample.steps)
        for f in findings
        if f.code != "ALU524" and "never gets there" not in f.message
    }


def found(findings):
    # Which skills share a counterexample of being lost, and which situation refutes a property, are matters of luck.
    return {(f.code, f.message.split(":")[0] if f.code == "ALU531" else f.message, f.severity) for f in findings if f.code != "ALU524"} | {
        ("ALU524", name, f.severity) for f in findings if f.code == "ALU524" for name in f.message.split("`")[1::2]
    }


# --- the runtime ------------------------------------------------------------------------------------------------------


class Bench:
    """An engine on a clock that the test sets."""

    def __init__(self, skillset):
        hooks = {skill.name: SkillHooks() for skill in skillset.skills}
        self.skillset = skillset
        self.now_ns = 0
        self.engine = SkillsetEngine(skillset, lambda: self.now_ns, hooks, lambda _events: None)

    def state(self):
        resources = tuple(self.engine.resources[resource.name].state for resource in self.skillset.resources)
        return resources, tuple(sorted(execution.skill for execution in self.engine.executions))

    def give(self, stimulus):
        engine = self.engine
        match stimulus:
            case ("extern", resource, state):
                engine.transition(resource, state)
            case ("event", event):
                engine.trigger(event)
            case ("start", skill):
                engine.request(skill, {})
            case ("result", _, execution, result):
                engine.terminate(execution, result)
            case ("interrupt", _, execution):
                engine.interrupt(execution)
            case ("fail", _, execution):
                engine.fail(execution, "asked to")
            case ("value", _, value):
                engine.update_data("d", value)
            case ("time", "to the next moment", _):
                self.now_ns = max(self.now_ns, engine.due_ns or 0)
                engine.tick()
            case ("time", "on", milliseconds):
                self.now_ns += milliseconds * 1_000_000
                engine.tick()

    def stimuli(self, copies):
        """Return what may be done now and is not refused, by kind, so that walks get somewhere."""
        skillset, running = self.skillset, [execution.skill for execution in self.engine.executions]
        situation = self.engine._context.situation
        kinds = {
            "extern": [(r.name, state) for r in skillset.resources for state in r.states],
            "event": [(event.name,) for event in skillset.events],
            "start": [(skill.name,) for skill in skillset.skills if running.count(skill.name) < copies],
            "value": [("d", value) for value in (*VALUES, None)] if skillset.data else [],
            "time": [("to the next moment", 0), ("on", 400)] if skillset.data else [],
            "result": [(e.skill, e.id, result.name) for e in self.engine.executions for result in skillset.skill(e.skill).results],
            "interrupt": [(e.skill, e.id) for e in self.engine.executions],
            "fail": [(e.skill, e.id) for e in self.engine.executions],
        }
        kinds["extern"] = [one for one in kinds["extern"] if not semantics.extern_refusal(skillset, situation, *one)]
        kinds["event"] = [one for one in kinds["event"] if not semantics.event_refusal(skillset, situation, *one)]
        return {kind: [(kind, *one) for one in several] for kind, several in kinds.items() if several}


def asked(edge, stimulus):
    """Return whether the checker's step is what a stimulus asks for; a failure does what an interruption does."""
    kind = {"fail": "interrupt"}.get(stimulus[0], stimulus[0])
    return edge.kind.value in {kind, "interrupt"} and edge.subject[0] == stimulus[1]


def followed(graph, numbers):
    """Return these situations and what data and time make of them: they break one execution after the other."""
    stuck = {(StepKind.INTERRUPT, s.name) for s in graph.system.skillset.skills if s.progress is not None}
    found, todo = set(numbers), list(numbers)
    while todo:
        for edge in graph.edges[todo.pop()]:
            if (edge.kind is StepKind.BREAK or (edge.kind, edge.subject[0]) in stuck) and edge.target not in found:
                found.add(edge.target)
                todo.append(edge.target)
    return found


LIKELY = {"start": 6, "value": 6, "time": 4, "event": 4, "extern": 3, "result": 1, "interrupt": 1, "fail": 1}
"""How likely a walk takes which kind of stimulus: executions are to live long enough for something to happen to them."""


def walk(skillset, seed, steps):
    """Give stimuli to the runtime; every situation that it comes to must be one that the checker's steps lead to."""
    graph = graph_of(skillset)
    if not graph.complete:
        return
    chance = random.Random(seed)  # noqa: S311 - nothing here is secret
    bench, numbers = Bench(skillset), {0}
    for _ in range(steps):
        stimuli = bench.stimuli(graph.system.copies)
        if not stimuli:
            return
        (kind,) = chance.choices(list(stimuli), [LIKELY[kind] for kind in stimuli])
        stimulus = chance.choice(stimuli[kind])
        before = bench.state()
        bench.give(stimulus)
        after = bench.state()
        ways = {e.target for n in numbers for e in graph.edges[n] if asked(e, stimulus)}
        if kind in {"value", "time"} or after == before:
            ways |= numbers
        if skillset.data:
            ways = followed(graph, ways)
        numbers = {n for n in ways if plain(graph.states[n]) == after}
        assert numbers, (stimulus, before, after)


SEEDS = st.integers(0, 2**32)


@settings(max_examples=60, **QUIET)
@given(skillsets(most_resources=2), SEEDS)
def test_the_runtime_goes_where_the_checker_says_and_nowhere_else(skillset, seed):
    walk(skillset, seed, 30)


@settings(max_examples=120, **QUIET)
@given(skillsets(most_resources=2, most_skills=2, timed=True), SEEDS)
def test_it_does_with_data_durations_and_deadlines_too(skillset, seed):
    walk(skillset, seed, 60)


@settings(max_examples=60, **QUIET)
@given(skillsets(most_resources=2))
def test_every_step_of_the_checker_can_be_taken_in_the_runtime(skillset):
    graph = graph_of(skillset)
    for number in range(min(len(graph.states), 12)):
        bench = Bench(skillset)
        for edge in graph.path(number):
            follow(bench, edge)
        assert bench.state() == plain(graph.states[number])


def plain(state):
    return state.resources, tuple(sorted(state.running))


def follow(bench, edge):
    """Take a step of the checker; of several executions of a skill any one: these tests compare what is left of all."""
    oldest = next((e.id for e in bench.engine.executions if e.skill == edge.subject[0]), "")
    match edge.kind:
        case StepKind.EXTERN | StepKind.EVENT | StepKind.START:
            bench.give((edge.kind.value, *edge.subject))
        case StepKind.RESULT:
            bench.give(("result", edge.subject[0], oldest, edge.subject[1]))
        case _:
            bench.give(("interrupt", edge.subject[0], oldest))


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
            # The test's models have no places: a `true` of theirs is taken for one that is not in the source.
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
    states = dict(states)
    for change in effect.assignments:
        source = states[change.resource]
        if source != change.target and not skillset.resource(change.resource).has_transition(source, change.target, extern=False):
            return False
        states[change.resource] = change.target
    return True


def after(effect, states):
    return {**states, **{change.resource: change.target for change in effect.assignments}}
