"""What the engine answers when it is asked: why, and what has been."""

from __future__ import annotations

import queue

import pytest
from runtime_models import AXES_FREE, RELEASE, SDK, Bench, flying_skill, flying_skillset

from alula.model.execution_state import ExecutionState
from alula.model.expressions import And, Comparison, DataIs, Not
from alula.model.model import Assignment, Data, Effect, Invariant, Precondition
from alula.runtime.managers import services

S = ExecutionState
FORBIDDEN = Effect("give_up", (Assignment("sdk", "UNAVAILABLE"),))
"""An arrow that is for the functional layer only."""


def test_a_skill_that_is_ready_says_so_and_nothing_is_changed():
    bench = Bench()
    before = len(bench.events)
    why = bench.engine.why("takeoff", {"height": 1.0})
    assert (why.ready, why.reason, why.unmet) == (True, "", ())
    assert bench.hooks["takeoff"].calls == ["validate"]
    assert len(bench.events) == before
    assert bench.states()["axes"] == "AVAILABLE"


def test_every_unmet_precondition_is_told_with_its_states_and_the_history():
    bench = Bench()
    execution = bench.run()
    bench.engine.transition("sdk", "UNAVAILABLE")
    why = bench.engine.why("takeoff")
    assert not why.ready
    assert [(one.name, dict(one.states)) for one in why.unmet] == [
        ("sdk_authority", {"sdk": "UNAVAILABLE"}),
        ("not_moving", {"axes": "USED"}),
    ]
    assert why.unmet[0].condition == "sdk == AVAILABLE"
    assert why.reason == "sdk_authority: sdk is UNAVAILABLE; not_moving: axes is USED"
    told = [(event.resource, event.from_state, event.to_state, event.cause) for event in why.history]
    assert told == [
        ("sdk", "UNAVAILABLE", "AVAILABLE", "extern"),
        ("axes", "AVAILABLE", "USED", f"takeoff {execution.id} take_control"),
        ("sdk", "AVAILABLE", "UNAVAILABLE", "extern"),
    ]
    assert [event.stamp_ns for event in why.history] == sorted(event.stamp_ns for event in why.history)


def test_the_history_keeps_the_last_transitions_only():
    bench = Bench()
    for _ in range(100):
        bench.engine.transition("sdk", "UNAVAILABLE")
        bench.engine.transition("sdk", "AVAILABLE")
    history = bench.engine.why("takeoff").history
    assert len(history) == 20
    assert history[-1].sequence == bench.events[-1].sequence


def test_data_start_effects_invariants_and_validate_count_too():
    charged = Precondition("charged", DataIs("battery", ("level",), Comparison.GE, 20, "%"))
    model = flying_skillset(flying_skill("takeoff", preconditions=(charged,)), data=(Data("battery", "Battery"),))
    bench = Bench(model)
    assert bench.engine.why("takeoff").reason == "charged: battery has no fresh value"
    assert bench.engine.why("takeoff").unmet[0].data == {"battery.level": None}
    bench.engine.update_data("battery", type("Battery", (), {"level": 0.1}))
    assert bench.engine.why("takeoff").unmet[0].data == {"battery.level": 0.1}
    bench = Bench(flying_skillset(flying_skill("takeoff", preconditions=(), start=FORBIDDEN)))
    assert [one.name for one in bench.engine.why("takeoff").unmet] == ["start effect"]
    assert "AVAILABLE -> UNAVAILABLE" in bench.engine.why("takeoff").reason
    bench = Bench(flying_skillset(flying_skill("takeoff", invariants=(Invariant("free", And((SDK, AXES_FREE)), RELEASE),))))
    assert [one.name for one in bench.engine.why("takeoff").unmet] == ["free"]
    bench = Bench()
    bench.hooks["takeoff"].acts["validate"] = lambda _: "too high"
    why = bench.engine.why("takeoff", {})
    assert (why.ready, why.refusal, why.reason) == (False, "too high", "too high")
    assert bench.engine.why("takeoff").ready
    bench.engine.close("shut down")
    assert bench.engine.why("takeoff").reason == "shut down"
    with pytest.raises(KeyError):
        bench.engine.why("nosuch")


def test_why_and_a_request_agree():
    skill = flying_skill("takeoff", preconditions=(Precondition("free", Not(Not(AXES_FREE))), Precondition("sdk", SDK)))
    bench = Bench(flying_skillset(skill), authority=False)
    for change in (lambda: None, lambda: bench.engine.transition("sdk", "AVAILABLE")):
        change()
        why = bench.engine.why("takeoff")
        execution = bench.run()
        assert why.ready == (execution.state is S.RUNNING)
        assert why.ready or why.unmet[0].name == execution.result


def test_each_skill_keeps_its_last_result_and_what_is_open():
    bench = Bench(flying_skillset(flying_skill("takeoff"), flying_skill("land")))
    assert bench.engine.skills["takeoff"].last is None
    first = bench.run(height=1.0)
    record = bench.engine.skills["takeoff"].open[0]
    assert (record.id, record.state, record.ended_ns) == (first.id, S.RUNNING, 0)
    first.terminate("DONE", "there", {"reached": 0.9})
    bench.run("land")
    last = bench.engine.skills["takeoff"].last
    assert (last.id, last.state, last.result, last.message) == (first.id, S.TERMINATED, "DONE", "there")
    assert (last.inputs, last.outputs) == ({"height": 1.0}, {"reached": 0.9})
    assert last.requested_ns < last.started_ns < last.ended_ns
    assert bench.engine.skills["takeoff"].open == ()
    assert [record.state for record in bench.engine.skills["land"].open] == [S.RUNNING]


def test_a_hook_that_stays_silent_is_answered_for_and_its_late_answer_is_dropped(monkeypatch):
    monkeypatch.setattr(services, "HOOK_ANSWERS_S", 0.1)
    told: queue.SimpleQueue[str] = queue.SimpleQueue()
    late = services._in_time(told.put, "silent")
    assert told.get(timeout=10.0) == "silent"
    late("after all")
    quick = services._in_time(told.put, "silent")
    quick("at once")
    quick("and again")
    assert told.get(timeout=10.0) == "at once"
    assert told.empty()
