"""What the engine answers when it is asked: why, and what has been."""

from __future__ import annotations

import json
import queue

import pytest

from alula.model.execution_state import ExecutionState
from alula.model.expressions import And, Comparison, DataIs, Not
from alula.model.model import Assignment, Data, Effect, Invariant, Precondition, Result, ResultKind
from alula.runtime.core.events import ExecutionEvent, event_record, read_event
from alula.runtime.managers import services
from alula_testing.runtime_models import AXES_FREE, RELEASE, SDK, Bench, flying_skill, flying_skillset
from alula_testing.waits import HANGS_S

S = ExecutionState
FORBIDDEN = Effect("give_up", (Assignment("sdk", "UNAVAILABLE"),))
"""A transition that is for the functional layer only."""


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
    assert (record.id, record.state, record.ended_ns) == (first.id, S.RUNNING, None)
    first.terminate("DONE", "there", {"reached": 0.9})
    bench.run("land")
    last = bench.engine.skills["takeoff"].last
    assert (last.id, last.state, last.result, last.message) == (first.id, S.TERMINATED, "DONE", "there")
    assert (last.inputs, last.outputs) == ({"height": 1.0}, {"reached": 0.9})
    assert last.requested_ns < last.started_ns < last.ended_ns
    assert bench.engine.skills["takeoff"].open == ()
    assert [record.state for record in bench.engine.skills["land"].open] == [S.RUNNING]


def test_what_happens_at_the_first_moment_of_mission_time_has_happened(monkeypatch):
    """Virtual time begins at 0, which is a stamp like any other: also for one that pauses and goes on later."""
    now_ns = 0
    monkeypatch.setattr(Bench, "clock", lambda _: now_ns)
    bench = Bench()
    execution = bench.run()
    now_ns = 5_000_000_000
    assert bench.engine.pause(execution.id).accepted
    assert bench.engine.resume(execution.id).accepted
    record = bench.engine.skills["takeoff"].open[0]
    assert (record.requested_ns, record.started_ns, record.ended_ns) == (0, 0, None)


def test_a_hook_that_stays_silent_is_answered_for_and_its_late_answer_is_dropped(monkeypatch):
    monkeypatch.setattr(services, "HOOK_ANSWERS_S", 0.1)
    told: queue.SimpleQueue[str] = queue.SimpleQueue()
    late = services._in_time(told.put, "silent")
    assert told.get(timeout=HANGS_S) == "silent"
    late("after all")
    monkeypatch.setattr(services, "HOOK_ANSWERS_S", HANGS_S)
    quick = services._in_time(told.put, "silent")
    quick("at once")
    quick("and again")
    assert told.get(timeout=HANGS_S) == "at once"
    assert told.empty()


# --- in the events ------------------------------------------------------------------------------------------------------


def last(bench: Bench) -> ExecutionEvent:
    """Return the last event of an execution, as it is read again from its record."""
    event = next(event for event in reversed(bench.events) if isinstance(event, ExecutionEvent))
    told = read_event(json.loads(json.dumps(event_record(event))))
    assert (told.unmet, told.result_kind) == (event.unmet, event.result_kind)
    return told


def test_a_refusal_tells_what_was_unmet_as_values_and_its_message_is_made_of_them():
    bench = Bench(authority=False)
    bench.run()
    (unmet,) = last(bench).unmet
    found = (unmet.name, unmet.condition, unmet.states, unmet.data)
    assert found == ("sdk_authority", "sdk == AVAILABLE", {"sdk": "UNAVAILABLE"}, {})
    assert (last(bench).result, last(bench).message) == (unmet.name, unmet.reason)
    assert unmet == bench.engine.why("takeoff").unmet[0]


def test_a_start_effect_that_is_no_transition_is_told_as_a_value():
    bench = Bench(flying_skillset(flying_skill("takeoff", preconditions=(), start=FORBIDDEN)))
    bench.run()
    (unmet,) = last(bench).unmet
    assert (unmet.name, unmet.condition, unmet.states) == ("start effect", "sdk -> UNAVAILABLE", {"sdk": "AVAILABLE"})
    assert last(bench).message == unmet.reason
    assert bench.engine.why("takeoff").unmet == (unmet,)


def test_a_violation_tells_the_states_that_broke_the_invariant_and_not_those_after_its_effect():
    free = Invariant("free", And((SDK, AXES_FREE)), RELEASE)
    bench = Bench(flying_skillset(flying_skill("takeoff", invariants=(free,))))
    bench.run()
    (unmet,) = last(bench).unmet
    assert (unmet.name, unmet.states) == ("free", {"sdk": "AVAILABLE", "axes": "USED"})
    assert bench.engine.why("takeoff").unmet == (unmet,)
    assert bench.states()["axes"] == "AVAILABLE"
    assert last(bench).message == f"{unmet.reason}, after axes AVAILABLE -> USED (takeoff {last(bench).id} take_control)"


def test_a_value_that_broke_an_invariant_is_told_and_one_that_is_not_fresh_is_none():
    charged = Invariant("charged", DataIs("battery", ("level",), Comparison.GE, 20, "%"), RELEASE)
    model = flying_skillset(flying_skill("takeoff", invariants=(charged,)), data=(Data("battery", "Battery"),))
    for value, found in ((type("Battery", (), {"level": 0.1}), 0.1), (None, None)):
        bench = Bench(model)
        bench.engine.update_data("battery", type("Battery", (), {"level": 0.5}))
        bench.run()
        bench.engine.update_data("battery", value)
        assert last(bench).state is S.RESOURCE_INVARIANT_VIOLATED
        assert [one.data for one in last(bench).unmet] == [{"battery.level": found}]


def test_an_end_by_a_result_tells_its_kind_and_no_other_state_does():
    results = (Result("UNLOCKED", ResultKind.SUCCESS), Result("DONE", ResultKind.FAILURE), Result("ARRIVED"))
    told = {}
    for result in results:
        bench = Bench(flying_skillset(flying_skill("takeoff", results=results)))
        bench.run().terminate(result.name)
        told[result.name] = [(one.state.value, one.result_kind) for one in bench.events if isinstance(one, ExecutionEvent)]
        assert last(bench).failed == (result.kind is ResultKind.FAILURE)
    begun = [("REQUESTED", None), ("RUNNING", None)]
    assert told == {result.name: [*begun, ("TERMINATED", result.kind)] for result in results}


def test_a_record_that_does_not_say_them_is_read_without():
    bench = Bench()
    bench.run().terminate("DONE")
    record = event_record(bench.events[-1])
    older = read_event({name: value for name, value in record.items() if name not in {"result_kind", "unmet"}})
    assert (older.result_kind, older.unmet, older.failed) == (None, (), False)


WRONG = [{"unmet": [{"name": "a"}]}, {"unmet": 3}, {"unmet": [3]}, {"result_kind": "good"}, {"result_kind": ["success"]}]


@pytest.mark.parametrize("wrong", WRONG)
def test_a_record_with_what_is_no_kind_and_not_unmet_is_refused(wrong):
    bench = Bench()
    bench.run().terminate("DONE")
    with pytest.raises(ValueError, match=r"no condition|not iterable|not subscriptable|is not a valid ResultKind"):
        read_event({**event_record(bench.events[-1]), **wrong})
