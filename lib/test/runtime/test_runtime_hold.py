"""Data, durations, hysteresis, progress deadlines and events in the engine, on a clock that the test sets."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alula.model.execution_state import ExecutionState
from alula.model.expressions import Comparison, DataIs, Implies, Or
from alula.model.model import Assignment, Data, Effect, Event, Hold, Interrupt, Invariant, Progress
from alula.runtime.core import SkillsetEngine
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.events import TransitionEvent
from alula_testing.recorder import Recorder
from alula_testing.runtime_models import AXES_USED, RELEASE, RESET, SDK, Bench, flying_skill, flying_skillset

S = ExecutionState
MS = 1_000_000
FPS = Data("fps", "float64", 0.5)
FAST = DataIs("fps", (), Comparison.GE, 10.0)


class Timed(Bench):
    """A bench whose clock stands until ``at`` sets it; nothing ticks by itself."""

    def clock(self) -> int:
        return self.now_ns

    def at(self, ms: float, *, tick: bool = True) -> None:
        self.now_ns = round(ms * MS)
        if tick:
            self.engine.tick()

    def fps(self, value: float | None) -> None:
        self.engine.update_data("fps", value)


def watching(hold: Hold | None = None, condition=FAST, **changes) -> Timed:
    """A skill that holds the axes while the camera is fast enough, running, with 30 fps at 0 ms."""
    skill = flying_skill("film", invariants=(Invariant("fast", condition, RELEASE, hold),), **changes)
    bench = Timed(flying_skillset(skill, data=(FPS,)))
    bench.fps(30.0)
    return bench


def test_a_value_breaks_an_invariant_in_the_step_that_brings_it():
    bench = watching()
    execution = bench.run("film")
    bench.fps(10.0)
    assert execution.state is S.RUNNING
    bench.fps(9.5)
    assert (execution.state, execution.result) == (S.RESOURCE_INVARIANT_VIOLATED, "fast")
    assert execution.message == "fast: fps is 9.5"
    assert [type(event).__name__ for event in bench.steps[-1]] == ["TransitionEvent", "ExecutionEvent"]
    assert bench.hooks["film"].calls[-1] == "on_violation"
    assert bench.engine.due_ns is None


@pytest.mark.parametrize("lost", [None, math.nan])
def test_no_fresh_value_is_no_good_value(lost):
    bench = watching()
    execution = bench.run("film")
    bench.fps(lost)
    assert (execution.state, execution.result) == (S.RESOURCE_INVARIANT_VIOLATED, "fast")
    assert "no fresh value" in execution.message or "not a number" in execution.message
    assert bench.run("film").state is S.RESOURCE_INVARIANT_VIOLATED  # nor is it at the start of another one


def test_what_resources_decide_does_not_hang_on_a_lost_value():
    either = Or((FAST, AXES_USED))
    for condition in (either, Implies(SDK, either)):
        bench = watching(condition=condition)
        execution = bench.run("film")
        bench.fps(None)
        assert execution.state is S.RUNNING


def test_a_duration_runs_out_to_the_nanosecond_and_is_told_beforehand():
    bench = watching(Hold(2.0))
    execution = bench.run("film")
    assert bench.engine.due_ns is None
    bench.at(100)
    bench.fps(3.0)
    assert bench.engine.due_ns == 2100 * MS
    bench.at(1500)
    bench.fps(4.0)
    assert bench.engine.due_ns == 2100 * MS
    bench.now_ns = 2100 * MS - 1
    bench.engine.tick()
    assert execution.state is S.RUNNING
    bench.at(2100)
    assert (execution.state, execution.result) == (S.RESOURCE_INVARIANT_VIOLATED, "fast")
    assert execution.message == "fast: fps is 4.0 for 2 s"
    assert bench.states()["axes"] == "AVAILABLE"


def test_a_break_in_a_duration_begins_it_again():
    bench = watching(Hold(2.0))
    execution = bench.run("film")
    bench.fps(3.0)
    bench.at(1999)
    bench.fps(10.0)
    assert bench.engine.due_ns is None
    bench.fps(None)
    assert bench.engine.due_ns == 3999 * MS
    bench.at(3998)
    assert execution.state is S.RUNNING
    bench.at(3999)
    assert "no fresh value" in execution.message


def test_time_before_the_start_does_not_count():
    bench = watching(Hold(2.0))
    bench.fps(3.0)
    bench.at(60_000)
    execution = bench.run("film")
    assert execution.state is S.RUNNING
    assert bench.engine.due_ns == 62_000 * MS


def test_a_late_tick_changes_no_outcome():
    bench = watching(Hold(2.0))
    execution = bench.run("film")
    bench.fps(3.0)
    bench.at(2500, tick=False)
    bench.fps(30.0)  # too late: no step had looked, but it had been too slow for 2 s
    assert execution.state is S.RESOURCE_INVARIANT_VIOLATED
    assert execution.message == "fast: fps is 3.0 for 2 s"


def test_a_value_that_has_fallen_is_good_again_from_the_recovery_value_on():
    bench = watching(Hold(2.0, hysteresis=12.0))
    execution = bench.run("film")
    bench.fps(11.0)
    assert bench.engine.due_ns is None  # 11 has not fallen
    bench.fps(9.0)
    bench.at(1000)
    bench.fps(11.9)
    assert bench.engine.due_ns == 2000 * MS
    bench.fps(12.0)
    assert bench.engine.due_ns is None
    bench.fps(11.0)
    bench.at(10_000)
    assert execution.state is S.RUNNING


def test_a_fallen_value_is_remembered_whatever_runs_and_a_lost_one_changes_nothing_in_that():
    bench = watching(Hold(hysteresis=12.0))
    bench.fps(9.0)
    bench.fps(None)
    bench.fps(11.0)
    assert bench.run("film").state is S.RESOURCE_INVARIANT_VIOLATED
    bench.fps(12.0)
    bench.fps(None)
    bench.fps(11.0)
    assert bench.run("film").state is S.RUNNING


def test_recovery_of_a_condition_that_excludes_its_threshold_includes_the_value():
    below = DataIs("fps", (), Comparison.LT, 50.0)
    bench = watching(Hold(1.0, hysteresis=40.0), condition=below)
    bench.run("film")
    bench.fps(50.0)
    assert bench.engine.due_ns == 1000 * MS
    bench.fps(40.0)
    assert bench.engine.due_ns is None


def test_an_invariant_of_resources_may_have_a_hold_too():
    skill = flying_skill("takeoff", invariants=(Invariant("keep_sdk", SDK, RELEASE, Hold(0.5)),))
    bench = Timed(flying_skillset(skill))
    execution = bench.run()
    bench.engine.transition("sdk", "UNAVAILABLE")
    bench.at(400)
    bench.engine.transition("sdk", "AVAILABLE")
    bench.engine.transition("sdk", "UNAVAILABLE")
    bench.at(899)
    assert execution.state is S.RUNNING
    bench.at(900)
    assert execution.message == "keep_sdk: sdk is UNAVAILABLE for 0.5 s"


def test_resources_come_before_data_and_one_end_follows_the_other():
    free = {"preconditions": (), "start": RESET, "interrupt": Interrupt()}
    first = flying_skill("first", invariants=(Invariant("fast", FAST, RELEASE),))
    second = flying_skill("second", invariants=(Invariant("used", AXES_USED, RESET), Invariant("fast", FAST, RESET)), **free)
    bench = Timed(flying_skillset(first, second, data=(FPS,)))
    bench.fps(30.0)
    runs = [bench.run("first"), bench.run("second")]
    bench.fps(1.0)
    # The end of the first frees the axes, which breaks the second before its own value is looked at.
    assert [run.result for run in runs] == ["fast", "used"]
    assert len(bench.steps[-1]) == 3


def stuck(**changes) -> Timed:
    skill = flying_skill("takeoff", progress=Progress(0.1, deadline_s=5.0), **changes)
    return Timed(flying_skillset(skill))


def test_an_execution_without_progress_fails_at_its_deadline():
    bench = stuck()
    execution = bench.run()
    assert bench.engine.due_ns == 5000 * MS
    bench.at(1000)
    bench.hooks["takeoff"].acts["progress"] = lambda _: 0.25
    assert bench.progress(execution) == 0.25
    assert bench.engine.due_ns == 6000 * MS
    bench.at(3000)
    bench.progress(execution)  # the same number again is no progress
    assert bench.engine.due_ns == 6000 * MS
    bench.at(6000)
    assert (execution.state, execution.message) == (S.FAILED, "no progress for 5 s")
    assert bench.hooks["takeoff"].calls[-1] == "on_failure"
    assert bench.states()["axes"] == "AVAILABLE"
    assert bench.engine.due_ns is None


def test_an_interruption_ends_the_wait_for_progress():
    bench = stuck()
    execution = bench.run()
    bench.hooks["takeoff"].acts["on_interrupt"] = lambda _: bench.at(9000)
    assert bench.engine.interrupt(execution.id)
    assert execution.state is S.INTERRUPTED


def test_a_result_that_comes_after_the_deadline_is_too_late():
    bench = stuck()
    execution = bench.run()
    bench.at(5001, tick=False)
    assert not bench.engine.terminate(execution.id, "DONE")
    assert execution.state is S.FAILED


LOSE_SDK = Event("lose_sdk", SDK, Effect("", (Assignment("sdk", "UNAVAILABLE"),)))


def test_an_event_is_taken_with_all_that_it_breaks():
    bench = Bench(flying_skillset(events=(LOSE_SDK,)))
    execution = bench.run()
    reply = bench.engine.trigger("lose_sdk")
    assert (reply.accepted, reply.reason) == (True, "")
    assert execution.result == "keep_sdk"
    transition = bench.steps[-1][0]
    assert isinstance(transition, TransitionEvent)
    assert (transition.resource, transition.to_state, transition.cause) == ("sdk", "UNAVAILABLE", "event lose_sdk")


def test_an_event_is_refused_with_a_reason_and_changes_nothing():
    wild = Event("wild", effect=Effect("", (Assignment("axes", "USED"), Assignment("sdk", "BROKEN"))))
    bench = Bench(flying_skillset(events=(LOSE_SDK, wild)), authority=False)
    assert bench.engine.trigger("lose_sdk").reason == "event lose_sdk: its guard is false: sdk is UNAVAILABLE"
    assert bench.engine.trigger("wild").reason == "event wild: resource sdk is UNAVAILABLE and has no transition UNAVAILABLE -> BROKEN"
    assert bench.engine.trigger("nosuch").reason == "skillset flying has no event nosuch; it has lose_sdk, wild"
    assert bench.events == []


def test_unknown_data_are_an_error_of_the_caller():
    with pytest.raises(SkillRuntimeError, match="no data nosuch; it has fps"):
        watching().engine.update_data("nosuch", 1.0)


def test_stop_hooks_of_what_time_ends_are_deferred():
    jobs: list = []
    skill = flying_skill("takeoff", progress=Progress(0.1, deadline_s=1.0))
    now = [0]
    hooks = {"takeoff": Recorder()}
    engine = SkillsetEngine(flying_skillset(skill), lambda: now[0], hooks, lambda _: None, defer=jobs.append)
    engine.transition("sdk", "AVAILABLE")
    engine.request("takeoff", {})
    now[0] = 1000 * MS
    engine.tick()
    assert hooks["takeoff"].calls == ["validate", "on_dispatch"]
    (job,) = jobs
    job()
    assert hooks["takeoff"].calls[-1] == "on_failure"


# --- against a slow and obvious reading of the language page -----------------------------------------------------------

STEP_MS = 250
TRACES = st.lists(st.sampled_from([None, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0]), min_size=1, max_size=24)
"""What is received every 250 ms from the start on; None is a lost value."""


def breaks_at_ms(values, hold):
    """Return when `fps >= 10` with ``hold`` is broken in a trace whose last value stays, by looking at every millisecond."""
    fallen, false_for_ms = False, 0
    for_ms = hold.for_s * 1000
    for now_ms in range(len(values) * STEP_MS + 5000):
        if for_ms and false_for_ms >= for_ms:
            return now_ms  # what comes now is too late
        value = values[min(now_ms // STEP_MS, len(values) - 1)]
        if value is not None and now_ms % STEP_MS == 0 and now_ms // STEP_MS < len(values):
            fallen = value < 10.0 or (fallen and value < (hold.hysteresis or 10.0))
        if value is not None and value >= 10.0 and not fallen:
            false_for_ms = 0
            continue
        if not for_ms:
            return now_ms
        false_for_ms += 1
    return None


@settings(max_examples=60)
@given(TRACES, st.sampled_from([Hold(0.5), Hold(1.0, 12.0), Hold(hysteresis=12.0), Hold(0.3, 11.0)]), st.booleans())
def test_an_invariant_breaks_when_the_page_says_so(values, hold, punctual):
    bench = watching(hold)
    execution = bench.run("film")
    for number, value in enumerate(values):
        pass_to(bench, number * STEP_MS, punctual=punctual)
        bench.fps(value)
    pass_to(bench, len(values) * STEP_MS + 4999, punctual=punctual)
    bench.engine.tick()
    expected_ms = breaks_at_ms(values, hold)
    assert execution.done == (expected_ms is not None)
    if punctual and expected_ms is not None:
        (ended,) = [event for event in bench.events if getattr(event, "state", None) is S.RESOURCE_INVARIANT_VIOLATED]
        assert ended.stamp_ns == expected_ms * MS


def pass_to(bench, at_ms, *, punctual):
    """Let time pass: ``punctual`` calls at each moment that is due on the way, else all is left to what comes next."""
    while punctual and (due_ns := bench.engine.due_ns) is not None and due_ns <= at_ms * MS:
        bench.at(due_ns / MS)
    bench.at(at_ms, tick=False)
