"""The stop contract: asked, done, too late; and pause and resume."""

from __future__ import annotations

import threading

import pytest

from alula.model.execution_state import ExecutionState
from alula.model.model import Interrupt
from alula.runtime.core.engine import DEFAULT_TIMEOUT_S
from alula.runtime.hooks import SkillHooks
from alula_testing.runtime_models import RELEASE, TAKE, Bench, flying_skill, flying_skillset
from alula_testing.waits import HANGS_S

S = ExecutionState
SECOND = 10**9


def bench_stopping_later(timeout_s: float | None = None, **options) -> Bench:
    skill = flying_skill("takeoff", interrupt=Interrupt(effect=RELEASE, timeout_s=timeout_s))
    bench = Bench(flying_skillset(skill), **options)
    bench.hooks["takeoff"].acts["on_interrupt"] = lambda _: False
    return bench


def wait_until_late(bench: Bench, timeout_s: float) -> None:
    """Tick just before the deadline, which changes nothing, and after it."""
    before = len(bench.events)
    bench.now_ns += int((timeout_s - 0.1) * SECOND)
    bench.engine.tick()
    assert len(bench.events) == before
    bench.now_ns += int(0.2 * SECOND)
    bench.engine.tick()


def test_a_stop_that_takes_time_holds_resources_until_it_is_done():
    bench = bench_stopping_later()
    execution = bench.run()
    assert bench.engine.due_ns is None
    assert bench.engine.interrupt(execution.id)
    assert execution.state is S.INTERRUPTING
    assert bench.states()["axes"] == "USED"
    assert bench.engine.interrupt(execution.id)  # again: known, nothing new
    assert bench.hooks["takeoff"].calls.count("on_interrupt") == 1
    assert execution.interrupted("hovering")
    assert (execution.state, execution.message, bench.states()["axes"]) == (S.INTERRUPTED, "hovering", "AVAILABLE")
    assert not execution.interrupted()
    assert bench.engine.due_ns is None
    assert bench.story()[-4:] == ["RUNNING", "INTERRUPTING", "axes AVAILABLE", "INTERRUPTED"]


def test_only_what_was_asked_for_is_interrupted():
    bench = Bench()
    execution = bench.run()
    assert not execution.interrupted()
    assert execution.state is S.RUNNING


@pytest.mark.parametrize(
    ("in_model", "options", "limit_s"), [(2.0, {}, 2.0), (None, {"interrupt_timeout_s": 3.0}, 3.0), (None, {}, DEFAULT_TIMEOUT_S)]
)
def test_a_stop_that_is_too_late_is_an_emergency(in_model, options, limit_s):
    bench = bench_stopping_later(in_model, **options)
    execution = bench.run()
    bench.engine.interrupt(execution.id)
    wait_until_late(bench, limit_s)
    assert bench.hooks["takeoff"].calls[-2:] == ["on_interrupt", "on_emergency"]
    assert (execution.state, bench.states()["axes"]) == (S.INTERRUPTED, "AVAILABLE")
    assert execution.message == f"the stop did not end within {limit_s:g} s; the emergency stop was called"
    assert not execution.interrupted()
    bench.engine.tick()
    assert bench.hooks["takeoff"].calls.count("on_emergency") == 1


@pytest.mark.parametrize("ending", ["result", "violation", "failure"])
def test_what_ends_a_stop_otherwise_is_no_emergency(ending):
    bench = bench_stopping_later()
    execution = bench.run()
    bench.engine.interrupt(execution.id)
    {
        "result": lambda: execution.terminate("DONE"),
        "violation": lambda: bench.engine.transition("sdk", "UNAVAILABLE"),
        "failure": lambda: execution.fail("no link"),
    }[ending]()
    assert execution.state in {S.TERMINATED, S.RESOURCE_INVARIANT_VIOLATED, S.FAILED}
    wait = bench.engine.due_ns
    bench.now_ns += 100 * SECOND
    bench.engine.tick()
    assert wait is None
    assert [call for call in bench.hooks["takeoff"].calls if call.startswith("on_")] == ["on_dispatch", "on_interrupt"]


@pytest.mark.parametrize("hanging", ["on_dispatch", "on_interrupt", "on_pause"])
def test_a_hook_that_hangs_delays_no_emergency_and_no_end(hanging):
    bench = bench_stopping_later(1.0)
    entered, release = threading.Event(), threading.Event()

    def hang(_):
        entered.set()
        release.wait(HANGS_S)

    recorder = bench.hooks["takeoff"]
    if hanging != "on_dispatch":
        execution = bench.run()
    recorder.acts[hanging] = hang
    blocked = {
        "on_dispatch": bench.run,
        "on_interrupt": lambda: bench.engine.interrupt(execution.id),
        "on_pause": lambda: bench.engine.pause(execution.id),
    }[hanging]
    thread = threading.Thread(target=blocked, daemon=True)
    thread.start()
    assert entered.wait(HANGS_S)
    execution = bench.engine.executions[0]
    assert bench.engine.interrupt(execution.id)
    wait_until_late(bench, 1.0)
    assert execution.state is S.INTERRUPTED
    assert bench.states()["axes"] == "AVAILABLE"
    release.set()
    thread.join(HANGS_S)
    assert recorder.calls.count("on_emergency") == 1
    assert recorder.calls.count("on_interrupt") == 1  # after the hook that hung: it may have started the function late
    recorder.acts.clear()
    assert bench.run().state is S.RUNNING


def test_an_emergency_hook_that_raises_is_told():
    bench = bench_stopping_later(1.0)
    bench.hooks["takeoff"].acts["on_emergency"] = lambda execution: execution.nosuch
    execution = bench.run()
    bench.engine.interrupt(execution.id)
    wait_until_late(bench, 1.0)
    assert execution.state is S.FAILED
    assert execution.message.startswith("on_emergency raised AttributeError")
    assert bench.states()["axes"] == "AVAILABLE"


def test_pause_and_resume_hold_resources_and_rest_the_function():
    bench = Bench()
    execution = bench.run()
    bench.progress(execution)
    assert bench.engine.pause(execution.id).accepted
    assert bench.engine.pause(execution.id).accepted  # as it is
    assert (execution.state, bench.states()["axes"]) == (S.PAUSED, "USED")
    assert bench.progress(execution) == 0.5
    assert bench.engine.resume(execution.id).accepted
    assert execution.state is S.RUNNING
    assert bench.story()[-3:] == ["RUNNING", "PAUSED", "RUNNING"]
    assert bench.hooks["takeoff"].calls == ["validate", "on_dispatch", "progress", "on_pause", "on_resume"]
    assert execution.terminate("DONE")


@pytest.mark.parametrize("ending", ["DONE", "violation", "interrupt"])
def test_a_paused_execution_can_end_in_every_way(ending):
    bench = Bench()
    execution = bench.run()
    bench.engine.pause(execution.id)
    state = {
        "DONE": (lambda: execution.terminate("DONE"), S.TERMINATED),
        "violation": (lambda: bench.engine.transition("sdk", "UNAVAILABLE"), S.RESOURCE_INVARIANT_VIOLATED),
        "interrupt": (lambda: bench.engine.interrupt(execution.id), S.INTERRUPTED),
    }[ending]
    state[0]()
    assert execution.state is state[1]


def test_pauses_are_refused_with_a_reason():
    bench = bench_stopping_later()
    assert "no execution nosuch" in bench.engine.pause("nosuch").reason
    plain = SkillHooks()
    bench.hooks["takeoff"].acts["on_pause"] = plain.on_pause
    execution = bench.run()
    reply = bench.engine.pause(execution.id)
    assert (reply.accepted, reply.reason) == (False, "takeoff can't be paused")
    assert execution.state is S.RUNNING
    bench.hooks["takeoff"].acts["on_pause"] = lambda e: bench.engine.interrupt(e.id) and ""
    reply = bench.engine.pause(execution.id)
    assert (reply.accepted, reply.reason) == (False, "it was INTERRUPTING before it was paused")
    assert bench.hooks["takeoff"].calls[-2:] == ["on_pause", "on_interrupt"]
    assert "is INTERRUPTING" in bench.engine.pause(execution.id).reason
    assert "is INTERRUPTING" in bench.engine.resume(execution.id).reason


@pytest.mark.parametrize(
    ("then", "answers", "state"),
    [
        ("", [(True, ""), (True, "")], S.RUNNING),
        ("terminate", [(False, "no execution"), (False, "no execution")], S.TERMINATED),
        ("interrupt", [(False, "INTERRUPTING"), (False, "INTERRUPTING")], S.INTERRUPTING),
        ("raise", [(False, "no execution"), (False, "no execution")], S.FAILED),
    ],
)
def test_what_is_asked_while_the_function_is_being_started_waits_for_its_turn(then, answers, state):
    bench = bench_stopping_later()
    replies = []

    def dispatch(execution):
        bench.engine.set_paused(execution.id, replies.append, paused=True)
        bench.engine.set_paused(execution.id, replies.append, paused=False)
        refusal = bench.engine.pause(execution.id)  # a wait for the answer in the hook itself is refused
        assert not refusal.accepted
        assert "being started" in refusal.reason
        assert replies == []
        if then == "terminate":
            execution.terminate("DONE")
        elif then == "interrupt":
            bench.engine.interrupt(execution.id)
        elif then == "raise":
            raise RuntimeError

    bench.hooks["takeoff"].acts["on_dispatch"] = dispatch
    execution = bench.run()
    assert execution.state is state
    assert [reply.accepted for reply in replies] == [accepted for accepted, _ in answers]
    assert all(reason in reply.reason for reply, (_, reason) in zip(replies, answers, strict=True))
    paused = ["on_pause", "on_resume"]
    assert [call for call in bench.hooks["takeoff"].calls if call in paused] == (paused if not then else [])


def test_a_request_can_be_interrupted_from_the_moment_it_is_taken_down():
    bench = Bench()
    execution = bench.engine.register("takeoff", {})
    assert bench.engine.interrupt(execution.id)
    bench.engine.run(execution.id)
    assert execution.state is S.INTERRUPTED
    assert bench.hooks["takeoff"].calls == []


def test_a_second_run_does_not_restart():
    bench = Bench(flying_skillset(flying_skill("takeoff", start=TAKE)))
    execution = bench.run()
    bench.engine.run(execution.id)
    assert bench.hooks["takeoff"].calls == ["validate", "on_dispatch"]
