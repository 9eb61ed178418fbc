"""Hooks that misbehave: each execution ends exactly once, for a reason that can be told, and the managers go on."""

from __future__ import annotations

import json
import math
import pickle
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.model.execution_state import ExecutionState
from alula.model.model import Interrupt, Invariant, Parameter, Result, Skill
from alula.runtime.core.events import ExecutionEvent, event_record, read_event
from alula.runtime.core.execution import Execution
from alula.runtime.core.hook_calls import call_hook
from alula.runtime.core.sanitize import TEXT_LIMIT, as_text
from alula.runtime.core.watchdog import TICK_S, Watchdog
from alula.runtime.workers import Workers
from alula_testing import waits
from alula_testing.misbehaviours import CIRCLE, MISBEHAVIOURS, Misbehaviour, Unprintable, returning
from alula_testing.runtime_models import AXES_USED, RELEASE, RESET, SDK, Bench, flying_skill, flying_skillset

S = ExecutionState


def watching() -> Skill:
    """A skill that needs nothing and holds nothing."""
    return flying_skill("watch", preconditions=(), start=RESET, invariants=(), interrupt=Interrupt(), results=(Result("DONE"),))


def bench_of_two(**options: object) -> Bench:
    """A skill that gives back what it holds however it ends, and one that stands beside it."""
    kept = (Invariant("keep_sdk", SDK, RELEASE), Invariant("in_control", AXES_USED, RESET))
    return Bench(flying_skillset(flying_skill("takeoff", invariants=kept), watching()), **options)


def provoke(bench: Bench, misbehaviour: Misbehaviour):
    """Have an execution's hook called; return the execution."""
    hook = misbehaviour.hook
    bench.hooks["takeoff"].acts[hook] = misbehaviour.act
    execution = bench.run()
    if hook == "progress":
        bench.progress(execution)
    elif hook == "on_interrupt":
        bench.engine.interrupt(execution.id)
    elif hook in {"on_pause", "on_resume"}:
        bench.engine.pause(execution.id)
        bench.engine.resume(execution.id)
    elif hook == "on_violation":
        bench.engine.transition("sdk", "UNAVAILABLE")
        bench.engine.transition("sdk", "AVAILABLE")
    elif hook == "on_failure":
        execution.fail("asked to")
    return execution


def ends(bench: Bench, execution) -> list[ExecutionEvent]:
    """Return the events of an execution's ends: one, if all is well."""
    return [e for e in bench.events if isinstance(e, ExecutionEvent) and e.id == execution.id and e.state.terminal]


def assert_fits_the_wire(value: object) -> None:
    """Texts of a message are UTF-8 without zeros, and not endless."""
    if isinstance(value, str):
        assert "\0" not in value
        assert len(value.encode()) < 2 * TEXT_LIMIT
    elif isinstance(value, dict):
        for part in value.values():
            assert_fits_the_wire(part)


def goes_on(bench: Bench) -> None:
    """Check that the skillset serves as if nothing had been."""
    bench.hooks["takeoff"].acts.clear()
    execution = bench.run()
    assert execution.terminate("DONE", "as ever"), execution.message
    assert [event.message for event in ends(bench, execution)] == ["as ever"]


@pytest.mark.parametrize("misbehaviour", MISBEHAVIOURS.values(), ids=MISBEHAVIOURS.keys())
def test_a_hook_that_misbehaves_ends_its_own_execution_only(misbehaviour):
    bench = bench_of_two()
    other = bench.run("watch")
    execution = provoke(bench, misbehaviour)
    assert execution.state.value == misbehaviour.outcome, execution.message
    assert misbehaviour.says in execution.message
    assert len(ends(bench, execution)) == 1
    for event in bench.events:
        assert_fits_the_wire(event_record(event))
        assert read_event(json.loads(json.dumps(event_record(event)))).sequence == event.sequence
    for error in bench.errors:
        assert_fits_the_wire(error)
    assert other.state is S.RUNNING
    goes_on(bench)
    assert other.terminate("DONE")
    assert bench.engine.executions == ()


# --- texts and outputs --------------------------------------------------------------------------------------------------


@given(st.text(st.characters(codec=None), max_size=30))
def test_any_text_becomes_one_that_fits_and_a_fit_one_stays(text):
    told = as_text(text)
    assert_fits_the_wire(told)
    assert as_text(told) == told


UNFIT = {
    "float64": ["far", None, [1.0], Unprintable(), True, 1 + 2j, 10**400],
    "uint8": [1.5, 256, -1, math.nan, "1", None],
    "bool": [1, "yes", None],
    "string": [5, b"bytes", None, Unprintable()],
    "Point": [CIRCLE],
}


@pytest.mark.parametrize(("kind", "value"), [(kind, value) for kind, values in UNFIT.items() for value in values], ids=lambda _: "")
@pytest.mark.parametrize("way", ["terminate", "set_outputs"])
def test_an_output_that_does_not_fit_its_type_ends_the_execution_and_is_named(kind, value, way):
    bench = Bench(flying_skillset(flying_skill("takeoff", outputs=(Parameter("reached", kind),))))
    execution = bench.run()
    if way == "terminate":
        execution.terminate("DONE", outputs={"reached": value})
    else:
        execution.set_outputs(reached=value)
    assert execution.state is S.FAILED
    assert "outputs of takeoff, reached takes a" in execution.message
    assert kind in execution.message
    assert execution.outputs == {}
    assert [event.state for event in ends(bench, execution)] == [S.FAILED]
    goes_on(bench)


@pytest.mark.parametrize(
    ("kind", "value", "kept"),
    [("float64", 3, 3.0), ("float64", math.inf, math.inf), ("uint8", 255.0, 255), ("string", "\udcff", "\\udcff"), ("bool", False, False)],
)
def test_an_output_that_fits_is_kept_as_its_type_holds_it(kind, value, kept):
    bench = Bench(flying_skillset(flying_skill("takeoff", outputs=(Parameter("reached", kind),))))
    execution = bench.run()
    assert execution.terminate("DONE", outputs={"reached": value})
    assert execution.state is S.TERMINATED
    assert execution.outputs == {"reached": kept}
    assert type(execution.outputs["reached"]) is type(kept)


@pytest.mark.parametrize("misbehaviour", MISBEHAVIOURS.values(), ids=MISBEHAVIOURS.keys())
def test_what_comes_of_a_hook_can_be_sent_to_another_process(misbehaviour):
    hooks = Bench().hooks["takeoff"]
    hooks.acts[misbehaviour.hook] = misbehaviour.act
    answer = call_hook(hooks, Execution(NoEngine(), "1", "takeoff", {}), misbehaviour.hook)
    assert pickle.loads(pickle.dumps(answer)) == answer  # noqa: S301 - our own


class NoEngine:
    """Knows no execution any more."""

    def __getattr__(self, name: str):
        return lambda *_: False


def test_an_end_that_cannot_be_told_with_its_values_is_told_without_them():
    bench = Bench()
    told: list[ExecutionEvent] = []

    def listener(events):
        if any(getattr(event, "outputs", None) for event in events):
            raise UnicodeEncodeError("utf-8", "\udcff", 0, 1, "surrogates not allowed")
        told.extend(event for event in events if isinstance(event, ExecutionEvent))

    bench.engine._outbox._listener = listener
    assert bench.run().terminate("DONE", "there", {"reached": 2.0})
    assert (told[-1].state, told[-1].result, told[-1].outputs) == (S.TERMINATED, "DONE", {})
    assert told[-1].message.startswith("there (inputs and outputs could not be published: UnicodeEncodeError")


# --- hooks that do not return -------------------------------------------------------------------------------------------


def test_the_watchdog_counts_its_own_ticks_and_finds_each_call_once():
    dog, found = Watchdog(), []
    slow, quick = dog.watch(1.0, lambda: found.append("slow")), dog.watch(1.0, lambda: found.append("quick"))
    assert dog.tick(1.0 + TICK_S / 2)
    assert quick.end()
    assert found == []
    assert not dog.tick(TICK_S)
    assert found == ["slow"]
    assert not slow.end()
    assert not dog.tick(10.0)
    assert found == ["slow"]


class Hanging:
    """An engine whose hooks are called by workers, as managers do, and hooks that hang until the test is over."""

    def __init__(self) -> None:
        self.go_on = threading.Event()
        self.errors: list[str] = []
        self.workers = Workers("hooks", self.errors.append)
        # The mission clock stands still: nothing but the watchdog can find them.
        self.bench = bench_of_two(defer=self.workers.submit, hook_timeout_s=0.2, interrupt_timeout_s=0.2)
        self.bench.clock = lambda: 1

    def hang(self, _: object) -> str:
        assert self.go_on.wait(waits.HANGS_S)
        return ""

    def run(self, skill: str = "takeoff"):
        execution = self.bench.engine.register(skill, {})
        self.bench.engine.run(execution.id, self.workers.submit)
        return execution

    def running(self):
        execution = self.run()
        waits.until(lambda: execution.state is S.RUNNING and self.bench.hooks["takeoff"].dispatched.is_set(), "it runs")
        return execution

    def close(self) -> None:
        self.go_on.set()
        assert self.workers.close(waits.HANGS_S)


@pytest.fixture
def hanging():
    hanging = Hanging()
    yield hanging
    hanging.close()


HANG = {
    "validate": ("FAILED", ["validate"]),
    "on_dispatch": ("FAILED", ["validate", "on_dispatch", "on_emergency", "on_failure"]),
    "progress": ("FAILED", ["validate", "on_dispatch", "progress", "on_failure"]),
    "on_interrupt": ("INTERRUPTED", ["validate", "on_dispatch", "on_interrupt", "on_emergency"]),
    "on_pause": ("FAILED", ["validate", "on_dispatch", "on_pause", "on_emergency", "on_failure"]),
    "on_violation": ("RESOURCE_INVARIANT_VIOLATED", ["validate", "on_dispatch", "on_violation", "on_emergency"]),
}


@pytest.mark.parametrize("hook", HANG)
def test_a_hook_that_does_not_return_ends_its_own_execution_and_stops_the_function(hanging, hook):
    bench, engine = hanging.bench, hanging.bench.engine
    outcome, calls = HANG[hook]
    bench.hooks["takeoff"].acts[hook] = hanging.hang
    replies: list = []
    execution = hanging.run() if hook in {"validate", "on_dispatch"} else hanging.running()
    provoked = {
        "progress": lambda: bench.progress(execution),
        "on_interrupt": lambda: engine.interrupt(execution.id),
        "on_pause": lambda: engine.set_paused(execution.id, replies.append, paused=True),
        "on_violation": lambda: engine.transition("sdk", "UNAVAILABLE"),
    }
    if hook in provoked:
        hanging.workers.submit(provoked[hook])
    other = hanging.run("watch")
    waits.until(lambda: execution.done and f"{hook} has not returned within" in " ".join(bench.errors), f"{execution} ends")
    assert execution.state.value == outcome
    assert other.state is S.RUNNING
    waits.until(lambda: "on_emergency" in bench.hooks["takeoff"].calls or "on_emergency" not in calls, "the strongest stop is called")
    hanging.go_on.set()
    waits.until(lambda: bench.hooks["takeoff"].calls == calls, f"the function is stopped: {bench.hooks['takeoff'].calls}")
    assert len(ends(bench, execution)) == 1
    assert [reply.accepted for reply in replies] == ([False] if hook == "on_pause" else [])
    waits.until(lambda: execution.id not in engine._context.entries, "it is forgotten")


def test_a_pause_that_waits_for_a_hook_that_hangs_is_answered(hanging):
    hanging.bench.hooks["takeoff"].acts["on_dispatch"] = hanging.hang
    execution = hanging.run()
    waits.until(lambda: execution.state is S.RUNNING, "it runs")
    replies: list = []
    hanging.bench.engine.set_paused(execution.id, replies.append, paused=True)
    waits.until(lambda: replies, "the pause is answered")
    assert "is open: it has ended, or never was" in replies[0].reason


def test_progress_that_takes_its_time_is_not_asked_again_and_holds_up_no_other_skill(hanging):
    bench, hooks = hanging.bench, hanging.bench.hooks
    hooks["takeoff"].acts["progress"] = hanging.hang
    execution, other = hanging.running(), hanging.run("watch")
    hanging.workers.submit(lambda: bench.progress(execution))
    waits.until(lambda: "progress" in hooks["takeoff"].calls, "the hook is called")
    assert bench.progress(execution) == 0.0
    assert hooks["takeoff"].calls.count("progress") == 1
    waits.until(lambda: other.state is S.RUNNING, "the other runs")
    assert bench.progress(other) == 0.5


@pytest.mark.parametrize("value", ["refused", None])
def test_a_question_is_answered_whatever_validate_does(hanging, value):
    hooks = hanging.bench.hooks["takeoff"]
    answers: list[str] = []
    hooks.acts["validate"] = hanging.hang if value is None else returning(value)
    hanging.workers.submit(lambda: hanging.bench.engine.ask_validate("takeoff", {}, answers.append))
    waits.until(lambda: answers, "the question is answered")
    assert answers == [value or "validate has not returned within 0.2 s"]
