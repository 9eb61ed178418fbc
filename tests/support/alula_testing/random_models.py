"""Random models and random programs, and what every trace of them must obey."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from itertools import pairwise, permutations

from hypothesis import strategies as st

from alula.model.conditions import holds
from alula.model.execution_state import ExecutionState
from alula.model.expressions import And, Implies, Not, Or, ResourceIs
from alula.model.model import Assignment, Effect, Interrupt, Invariant, Precondition, Resource, Result, Skill, Skillset, Transition
from alula.runtime.core import ExecutionEvent, TransitionEvent

S = ExecutionState
JOIN_S = 20.0
RESOURCES = ("r0", "r1", "r2")
SKILLS = ("s0", "s1", "s2")
RESULTS = ("A", "B", "NOSUCH")
STOPS = ("on_interrupt", "on_violation", "on_failure")
HOOKS = ("validate", "on_dispatch", "progress", *STOPS, "on_pause", "on_resume", "on_emergency")
FOREVER_NS = 10**12


@st.composite
def machines(draw, name):
    states = ("X", "Y", "Z")[: draw(st.integers(2, 3))]
    pairs = [*permutations(states, 2), *((state, state) for state in states)]
    transitions = draw(st.lists(st.tuples(st.sampled_from(pairs), st.booleans()), min_size=2, unique=True))
    return Resource(name, states, draw(st.sampled_from(states)), tuple(Transition(*pair, extern=extern) for pair, extern in transitions))


def conditions(resources):
    leaf = st.sampled_from(resources).flatmap(lambda r: st.builds(ResourceIs, st.just(r.name), st.sampled_from(r.states), st.booleans()))
    return st.recursive(
        leaf,
        lambda inner: st.one_of(
            st.builds(Not, inner),
            st.builds(Implies, inner, inner),
            st.lists(inner, min_size=2, max_size=3).map(lambda x: And(tuple(x))),
            st.lists(inner, min_size=2, max_size=3).map(lambda x: Or(tuple(x))),
        ),
        max_leaves=4,
    )


def effects(resources, name):
    steps = [Assignment(r.name, state) for r in resources for state in r.states]
    chosen = st.lists(st.sampled_from(steps), max_size=2, unique_by=lambda a: a.resource)
    return chosen.map(lambda assignments: Effect(name, tuple(assignments)))


@st.composite
def skills(draw, name, resources):
    some = conditions(resources)
    return Skill(
        name=name,
        preconditions=tuple(Precondition(f"p{i}", c) for i, c in enumerate(draw(st.lists(some, max_size=1)))),
        start=draw(effects(resources, "begin")),
        invariants=tuple(
            Invariant(f"i{i}", c, draw(effects(resources, f"violation{i}"))) for i, c in enumerate(draw(st.lists(some, max_size=2)))
        ),
        interrupt=Interrupt(effect=draw(effects(resources, "cut"))),
        results=tuple(Result(n, effect=draw(effects(resources, f"end{n}"))) for n in ("A", "B")),
    )


@st.composite
def skillsets(draw, names=SKILLS):
    resources = tuple(draw(machines(name)) for name in RESOURCES[: draw(st.integers(1, 3))])
    return Skillset("random", resources=resources, skills=tuple(draw(skills(name, resources)) for name in names))


ACTS = st.sampled_from(["", "", "", "slow", "later", "raise", "terminate", "interrupt", "fail", "refuse", "transition"])
BEHAVIOURS = st.fixed_dictionaries(dict.fromkeys(HOOKS, ACTS))
OPERATIONS = st.one_of(
    st.tuples(st.just("request"), st.sampled_from(SKILLS)),
    st.tuples(st.just("request"), st.sampled_from(SKILLS)),
    st.tuples(st.just("transition"), st.sampled_from(RESOURCES), st.sampled_from(["X", "Y", "Z"])),
    st.tuples(st.sampled_from(["terminate"]), st.integers(0, 5), st.sampled_from(RESULTS)),
    st.tuples(st.sampled_from(["interrupt", "fail", "progress", "pause", "resume", "interrupted"]), st.integers(0, 5)),
    st.tuples(st.just("time"), st.sampled_from([10**9, 10**10])),
)
PROGRAMS = st.lists(st.lists(OPERATIONS, min_size=1, max_size=12), min_size=1, max_size=3)


def act(bench, what, execution):
    """Do in a hook what the random program says."""
    if what == "raise":
        raise RuntimeError("hook")
    if what == "transition":
        bench.engine.transition("r0", "Y")
    elif what == "terminate" and hasattr(execution, "terminate"):
        execution.terminate("A")
    elif what == "fail" and hasattr(execution, "fail"):
        execution.fail("hook says so")
    elif what == "interrupt" and hasattr(execution, "id"):
        bench.engine.interrupt(execution.id)
    elif what == "slow":
        time.sleep(0.001)  # that it takes time is the subject: others come in between
    return {"refuse": "no", "terminate": 0.5, "later": False}.get(what)


def give_hooks(bench, behaviours, running):
    """Make each skill's recorder act, and write down (id, hook, begin or end) in ``running``."""
    for name, recorder in bench.hooks.items():
        for hook in HOOKS:

            def call(execution, hook=hook, what=behaviours[name][hook]):
                identifier = getattr(execution, "id", "")
                running.append((identifier, hook, "begin"))
                try:
                    answer = act(bench, what, execution)
                finally:
                    running.append((identifier, hook, "end"))
                fits = {"validate": str, "on_pause": str, "on_resume": str, "on_interrupt": bool}.get(hook, type(None))
                return answer if isinstance(answer, fits) else None

            recorder.acts[hook] = call


def perform(bench, ids, program):
    for operation in program:
        match operation:
            case ("request", skill):
                ids.append(bench.run(skill).id)
            case ("transition", resource, to):
                bench.engine.transition(resource, to)
            case ("time", step_ns):
                bench.now_ns += step_ns
                bench.engine.tick()
            case ("terminate", index, result) if ids:
                bench.engine.terminate(ids[index % len(ids)], result)
            case ("progress", index) if ids:
                bench.engine.ask_progress(ids[index % len(ids)], lambda _: None)
            case (what, index) if ids:
                arguments = ("asked for",) if what == "fail" else ()
                getattr(bench.engine, what)(ids[index % len(ids)], *arguments)


def run_all(bench, programs):
    ids: list[str] = []
    raised: list[Exception] = []

    def body(program):
        try:
            perform(bench, ids, program)
        except Exception as error:  # noqa: BLE001 - told in the main thread
            raised.append(error)

    threads = [threading.Thread(target=body, args=(program,), daemon=True) for program in programs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(JOIN_S)
    assert not any(thread.is_alive() for thread in threads), "deadlock"
    assert raised == []


def check_resources(bench):
    """Every change is a transition of the right kind from the state that the resource was in; the last ones are the present."""
    states = {resource.name: resource.initial for resource in bench.skillset.resources}
    for event in bench.events:
        if isinstance(event, TransitionEvent):
            assert event.from_state == states[event.resource]
            machine = bench.skillset.resource(event.resource)
            assert machine.has_transition(event.from_state, event.to_state, extern=event.cause == "extern")
            states[event.resource] = event.to_state
    assert states == bench.states()


def check_executions(bench):
    """Figure 5, for each execution; at the end those that are not done are those the engine knows."""
    told = defaultdict(list)
    for event in bench.events:
        if isinstance(event, ExecutionEvent):
            told[event.id].append(event.state)
    ends = {*(state for state in S if state.terminal and state not in {S.NOT_VALIDATED, S.NOT_READY})}
    follows = {
        S.REQUESTED: {S.RUNNING, S.NOT_VALIDATED, S.NOT_READY, S.INTERRUPTED, S.FAILED},
        S.RUNNING: {S.PAUSED, S.INTERRUPTING, *ends} - {S.INTERRUPTED},
        S.PAUSED: {S.RUNNING, S.INTERRUPTING, *ends} - {S.INTERRUPTED},
        S.INTERRUPTING: ends,
    }
    for states in told.values():
        assert states[0] is S.REQUESTED
        assert all(after in follows.get(before, ()) for before, after in pairwise(states))
    assert {i for i, states in told.items() if not states[-1].terminal} == {e.id for e in bench.engine.executions}
    return told


def called_for(skill, event, before):
    """Return the effect that an execution's new state calls for; ``before`` are the states it was in."""
    match event.state:
        case S.RUNNING if S.RUNNING not in before:  # again after a pause
            return skill.start
        case S.TERMINATED:
            return skill.result(event.result).effect
        case S.RESOURCE_INVARIANT_VIOLATED:
            return next(i.effect for i in skill.invariants if i.name == event.result)
        case S.INTERRUPTED | S.FAILED if S.RUNNING in before:
            return skill.interrupt.effect
    return Effect()


def check_effects(bench):
    """Each effect that an execution's states call for was applied once and whole, just before, and no other.

    What is in the wanted state already does not change.
    """
    states = {resource.name: resource.initial for resource in bench.skillset.resources}
    before = defaultdict(list)
    pending: list[TransitionEvent] = []
    for event in bench.events:
        if isinstance(event, TransitionEvent):
            pending.append(event)
            continue
        own = [change for change in pending if change.cause.startswith(f"{event.skill} {event.id} ")]
        states |= {change.resource: change.to_state for change in pending if change not in own}
        effect = called_for(bench.skillset.skill(event.skill), event, before[event.id])
        wanted = [(a.resource, a.target) for a in effect.assignments if states[a.resource] != a.target]
        found = [(change.resource, change.to_state) for change in own]
        impossible = event.state is S.RESOURCE_INVARIANT_VIOLATED and "has no transition" in event.message
        assert found == ([] if impossible or (event.state is S.FAILED and not own) else wanted)
        states |= {change.resource: change.to_state for change in own}
        before[event.id].append(event.state)
        pending = []


def check_invariants(bench):
    """After each step every running execution's invariants hold."""
    states = {resource.name: resource.initial for resource in bench.skillset.resources}
    running = {}
    for step in bench.steps:
        for event in step:
            if isinstance(event, TransitionEvent):
                states[event.resource] = event.to_state
            elif event.state.active:
                running[event.id] = event.skill
            else:
                running.pop(event.id, None)
        for skill in running.values():
            for invariant in bench.skillset.skill(skill).invariants:
                assert holds(invariant.condition, states, {}), (skill, invariant.name, states)


def check_hooks(running):
    """At most one stop hook an execution; none of them, nor any pause, overtakes the hook that is being called."""
    by_id = defaultdict(list)
    for identifier, hook, what in list(running):
        by_id[identifier].append((hook, what))
    by_id.pop("", None)
    for calls in by_id.values():
        stops = [index for index, (hook, what) in enumerate(calls) if what == "begin" and hook in STOPS]
        assert len(stops) <= 1
        assert calls.count(("on_dispatch", "begin")) <= 1
        assert calls.count(("on_emergency", "begin")) <= 1
        one_by_one = [call for call in calls if call[0] in {"on_dispatch", "on_pause", "on_resume", *STOPS}]
        for (hook, what), (after, then) in zip(one_by_one[::2], one_by_one[1::2], strict=False):
            assert (what, hook, then) == ("begin", after, "end"), calls
        assert not stops or ("on_dispatch", "end") in calls[: stops[0]]


def check_records(bench):
    """What a late client is told is what has happened."""
    last = {event.skill: event for event in bench.events if isinstance(event, ExecutionEvent) and event.state.terminal}
    for name, record in bench.engine.skills.items():
        assert record.open == ()
        assert (record.last and (record.last.id, record.last.state)) == ((name in last and (last[name].id, last[name].state)) or None)
