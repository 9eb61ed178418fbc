"""The rules of DESIGN's execution, one by one."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import pytest

from alula.model.execution_state import ExecutionState
from alula.model.expressions import And, Comparison, DataIs, Not
from alula.model.model import Assignment, Data, Effect, Event, Interrupt, Invariant, Precondition, Result
from alula.runtime.core import SkillsetEngine
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.events import TransitionEvent
from alula.runtime.core.hook_calls import LocalHooks
from alula.runtime.hooks import SkillHooks
from alula_testing.recorder import Recorder
from alula_testing.runtime_models import AXES_FREE, AXES_USED, RELEASE, RESET, SDK, Bench, flying_skill, flying_skillset
from alula_testing.waits import HANGS_S

S = ExecutionState


def test_a_whole_execution_tells_its_story_in_order():
    bench = Bench()
    execution = bench.run(height=3.0)
    assert execution.state is S.RUNNING
    assert bench.progress(execution) == 0.5
    assert execution.terminate("DONE", "there", {"reached": 2.9})
    assert (execution.state, execution.result, execution.message, execution.outputs) == (S.TERMINATED, "DONE", "there", {"reached": 2.9})
    assert bench.story() == ["sdk AVAILABLE", "REQUESTED", "axes USED", "RUNNING", "axes AVAILABLE", "TERMINATED"]
    assert [event.sequence for event in bench.events] == [1, 2, 3, 4, 5, 6]
    assert bench.events[4].cause == f"takeoff {execution.id} release_control"
    assert bench.events[0].cause == "extern"
    assert bench.hooks["takeoff"].calls == ["validate", "on_dispatch", "progress"]
    assert bench.engine.executions == ()


class HooksElsewhere(LocalHooks):
    """Hooks whose answers arrive when ``arrive`` is called, as from another process."""

    def __init__(self, skillset, hooks) -> None:
        super().__init__(skillset, hooks)
        self._answers: list = []

    def call(self, execution, hook, then) -> None:
        super().call(execution, hook, lambda answer: self._answers.append(lambda: then(answer)))

    def arrive(self) -> None:
        while self._answers:
            self._answers.pop(0)()


def test_a_progress_that_arrives_later_counts_as_well():
    skillset = flying_skillset()
    hooks = HooksElsewhere(skillset, {skill.name: Recorder() for skill in skillset.skills})
    engine = SkillsetEngine(skillset, lambda: 0, hooks, lambda _: None)
    assert engine.transition("sdk", "AVAILABLE").accepted
    execution = engine.request("takeoff", {})
    hooks.arrive()
    assert execution.state is S.RUNNING
    told: list = []
    engine.ask_progress(execution.id, told.append)
    assert told == []
    engine.ask_progress(execution.id, told.append)
    assert told == [0.0], "it is asked already"
    hooks.arrive()
    assert told == [0.0, 0.5]
    assert execution.progress == 0.5


def test_validate_refuses_in_its_own_words():
    bench = Bench()
    bench.hooks["takeoff"].acts["validate"] = lambda inputs: f"{inputs['height']} m is too high"
    execution = bench.run(height=300)
    assert (execution.state, execution.message) == (S.NOT_VALIDATED, "300 m is too high")
    assert bench.hooks["takeoff"].calls == ["validate"]


@pytest.mark.parametrize(("wrote", "jobs"), [((), 0), (("on_dispatch",), 1), (("validate",), 1), (("validate", "on_dispatch"), 1)])
def test_only_written_hooks_are_given_a_thread(wrote, jobs):
    called = []
    hooks = type("Hooks", (SkillHooks,), {hook: lambda _, given, hook=hook: called.append(hook) or "" for hook in wrote})()
    skillset = flying_skillset()
    engine = SkillsetEngine(skillset, lambda: 0, {skill.name: hooks for skill in skillset.skills}, lambda _: None)
    assert engine.transition("sdk", "AVAILABLE").accepted
    execution = engine.register("takeoff", {})
    waiting = []
    engine.run(execution.id, waiting.append)
    assert len(waiting) == jobs
    assert (execution.state, called) == (S.REQUESTED if "validate" in wrote else S.RUNNING, [])
    for job in waiting:
        job()
    assert (execution.state, called) == (S.RUNNING, list(wrote))
    assert engine.interrupt(execution.id)
    assert execution.state is S.INTERRUPTED


def test_not_ready_names_the_precondition_and_the_states():
    bench = Bench(authority=False)
    execution = bench.run()
    assert (execution.state, execution.result) == (S.NOT_READY, "sdk_authority")
    assert execution.message == "sdk_authority: sdk is UNAVAILABLE"
    assert bench.hooks["takeoff"].calls == ["validate"]


def test_a_refusal_says_after_which_explained_change_it_came():
    bench = Bench()
    bench.engine.transition("sdk", "UNAVAILABLE", "the vehicle is in RTL")
    refused = bench.run()
    assert refused.state is S.NOT_READY
    assert refused.message == "sdk_authority: sdk is UNAVAILABLE, after sdk AVAILABLE -> UNAVAILABLE (extern): the vehicle is in RTL"
    assert [one.reason for one in refused.unmet] == ["sdk_authority: sdk is UNAVAILABLE"]
    bench.engine.transition("sdk", "AVAILABLE", "it is in GUIDED")
    running = bench.run()
    second = bench.run()
    assert running.state is S.RUNNING
    assert second.message == "not_moving: axes is USED", "what a skill changed is no reason of the functional layer"


def test_a_second_execution_is_for_the_preconditions_to_forbid():
    bench = Bench()
    first = bench.run()
    second = bench.run()
    assert (second.state, second.result) == (S.NOT_READY, "not_moving")
    assert first.state is S.RUNNING
    free = flying_skill("watch", preconditions=(), start=RESET, invariants=(), interrupt=Interrupt(), results=(Result("DONE"),))
    bench = Bench(flying_skillset(free))
    assert [bench.run("watch").state, bench.run("watch").state] == [S.RUNNING, S.RUNNING]


LOSE_SDK = Effect("lose_sdk", (Assignment("sdk", "UNAVAILABLE"),))  # an extern transition: not for skills


def test_a_start_effect_that_is_no_transition_refuses_and_names_all():
    skill = flying_skill("takeoff", preconditions=(), start=LOSE_SDK)
    execution = Bench(flying_skillset(skill)).run()
    assert execution.state is S.NOT_READY
    for word in ("takeoff", "lose_sdk", "sdk", "AVAILABLE -> UNAVAILABLE for skills"):
        assert word in execution.message


def test_a_resource_that_is_in_the_wanted_state_stays_there_without_a_change():
    skill = flying_skill("takeoff", preconditions=(), start=RELEASE, invariants=())
    bench = Bench(flying_skillset(skill))
    execution = bench.run()
    assert execution.state is S.RUNNING
    execution.terminate("DONE")
    assert bench.story() == ["sdk AVAILABLE", "REQUESTED", "RUNNING", "TERMINATED"]


def test_changes_of_one_resource_follow_each_other():
    there_and_back = Effect("blink", (Assignment("axes", "USED"), Assignment("axes", "AVAILABLE")))
    skill = flying_skill("takeoff", preconditions=(), start=there_and_back, invariants=())
    bench = Bench(flying_skillset(skill))
    bench.run()
    assert bench.story()[1:] == ["REQUESTED", "axes USED", "axes AVAILABLE", "RUNNING"]


def test_effects_are_applied_as_one_or_not_at_all():
    both = Effect("both", (Assignment("axes", "AVAILABLE"), Assignment("sdk", "UNAVAILABLE")))  # sdk is not for skills
    bench = Bench(flying_skillset(flying_skill("takeoff", results=(Result("DONE", effect=both),), interrupt=Interrupt())))
    execution = bench.run()
    execution.terminate("DONE")
    assert execution.state is S.FAILED
    assert "sdk is AVAILABLE and has no transition AVAILABLE -> UNAVAILABLE for skills" in execution.message
    assert bench.states() == {"sdk": "AVAILABLE", "axes": "USED"}


def test_a_failure_gives_back_what_the_skill_holds():
    bench = Bench()
    execution = bench.run()
    execution.terminate("NOSUCH")
    assert execution.state is S.FAILED
    assert "no result NOSUCH" in execution.message
    assert bench.states()["axes"] == "AVAILABLE"


def test_extern_transitions_are_refused_with_a_reason():
    bench = Bench()
    assert "no resource" in bench.engine.transition("nosuch", "A").reason
    assert "no state NOSUCH" in bench.engine.transition("sdk", "NOSUCH").reason
    assert "for skills only" in bench.engine.transition("axes", "USED").reason
    reply = bench.engine.transition("sdk", "AVAILABLE")
    assert (reply.accepted, reply.state) == (False, "AVAILABLE")
    assert "sdk is AVAILABLE" in reply.reason
    assert bench.story() == ["sdk AVAILABLE"]


def test_the_reason_of_a_transition_is_told_by_its_event_and_by_what_it_breaks():
    bench = Bench()
    execution = bench.run()
    assert bench.engine.transition("sdk", "UNAVAILABLE", "the pilot has it").accepted
    event = bench.steps[-1][0]
    assert isinstance(event, TransitionEvent)
    assert (event.cause, event.reason) == ("extern", "the pilot has it")
    assert bench.engine.resources["sdk"].reason == "the pilot has it"
    assert execution.message.endswith("after sdk AVAILABLE -> UNAVAILABLE (extern): the pilot has it")
    assert bench.engine.transition("sdk", "AVAILABLE").accepted
    assert bench.engine.resources["sdk"].reason == ""


def test_a_broken_invariant_ends_in_the_same_step_and_stops_the_function():
    bench = Bench()
    execution = bench.run()
    bench.engine.transition("sdk", "UNAVAILABLE")
    assert (execution.state, execution.result) == (S.RESOURCE_INVARIANT_VIOLATED, "keep_sdk")
    assert execution.message == "keep_sdk: sdk is UNAVAILABLE, after sdk AVAILABLE -> UNAVAILABLE (extern)"
    assert [type(event).__name__ for event in bench.steps[-1]] == ["TransitionEvent", "ExecutionEvent"]
    assert bench.hooks["takeoff"].calls == ["validate", "on_dispatch", "on_violation"]
    assert bench.states()["axes"] == "USED"  # the paper's reset {} leaves it


def test_violations_cascade_in_order_of_start_and_none_is_mended_by_another():
    # a holds axes; when sdk goes, a releases them, which breaks b; c watches sdk like a and would be mended by nothing.
    quiet = {"preconditions": (), "start": RESET, "interrupt": Interrupt(), "results": (Result("DONE"),)}
    a = flying_skill("a", invariants=(Invariant("sdk", SDK, RELEASE),))
    b = flying_skill("b", invariants=(Invariant("axes_used", AXES_USED, RESET),), **quiet)
    c = flying_skill("c", invariants=(Invariant("sdk_or_free", Not(And((Not(SDK), AXES_USED))), RESET),), **quiet)
    bench = Bench(flying_skillset(a, b, c))
    runs = [bench.run(name) for name in "abc"]
    bench.engine.transition("sdk", "UNAVAILABLE")
    assert [run.result for run in runs] == ["sdk", "axes_used", "sdk_or_free"]
    assert [(getattr(e, "skill", ""), getattr(e, "resource", "")) for e in bench.steps[-1]] == [
        ("", "sdk"), ("", "axes"), ("a", ""), ("c", ""), ("b", ""),
    ]  # fmt: skip
    assert "(a " in runs[1].message
    assert "sdk AVAILABLE -> UNAVAILABLE" in runs[2].message


def test_a_violation_effect_that_is_no_transition_is_told_and_not_applied():
    skill = flying_skill("takeoff", invariants=(Invariant("free", AXES_FREE, LOSE_SDK),), start=RESET)
    bench = Bench(flying_skillset(skill, flying_skill("land", invariants=())))
    execution = bench.run()
    bench.run("land")
    assert execution.state is S.RESOURCE_INVARIANT_VIOLATED
    assert "AVAILABLE -> UNAVAILABLE" in execution.message
    assert bench.states() == {"sdk": "AVAILABLE", "axes": "USED"}


def test_an_invariant_false_from_the_start_dispatches_nothing():
    skill = flying_skill("takeoff", invariants=(Invariant("free", AXES_FREE, RELEASE),))
    bench = Bench(flying_skillset(skill))
    execution = bench.run()
    assert (execution.state, execution.result) == (S.RESOURCE_INVARIANT_VIOLATED, "free")
    assert bench.story()[1:] == ["REQUESTED", "axes USED", "RUNNING", "axes AVAILABLE", "RESOURCE_INVARIANT_VIOLATED"]
    assert bench.hooks["takeoff"].calls == ["validate"]


def test_interrupt_stops_the_function_then_applies_its_effect():
    bench = Bench()
    execution = bench.run()
    seen = []
    bench.hooks["takeoff"].acts["on_interrupt"] = lambda e: seen.append((e.state, bench.states()["axes"]))
    assert bench.engine.interrupt(execution.id)
    assert seen == [(S.INTERRUPTING, "USED")]
    assert execution.state is S.INTERRUPTED
    assert bench.states()["axes"] == "AVAILABLE"
    assert not bench.engine.interrupt(execution.id)


def test_a_hook_may_end_its_own_execution_anywhere():
    for hook in ("on_dispatch", "on_interrupt", "progress"):
        bench = Bench()
        bench.hooks["takeoff"].acts[hook] = lambda e: e.terminate("DONE") and 1.0
        execution = bench.run()
        bench.progress(execution)
        bench.engine.interrupt(execution.id)
        assert execution.state is S.TERMINATED
        assert bench.story().count("TERMINATED") == 1


def test_an_interrupt_during_dispatch_follows_it():
    bench = Bench()
    bench.hooks["takeoff"].acts["on_dispatch"] = lambda e: bench.engine.interrupt(e.id)
    execution = bench.run()
    assert execution.state is S.INTERRUPTED
    assert bench.hooks["takeoff"].calls == ["validate", "on_dispatch", "on_interrupt"]


def test_a_violation_during_dispatch_stops_after_it():
    bench = Bench()
    bench.hooks["takeoff"].acts["on_dispatch"] = lambda _: bench.engine.transition("sdk", "UNAVAILABLE")
    execution = bench.run()
    assert execution.state is S.RESOURCE_INVARIANT_VIOLATED
    assert bench.hooks["takeoff"].calls == ["validate", "on_dispatch", "on_violation"]


def test_an_interrupt_during_validate_never_starts():
    bench = Bench()
    bench.hooks["takeoff"].acts["validate"] = lambda _: bench.engine.interrupt(bench.engine.executions[0].id) and ""
    execution = bench.run()
    assert execution.state is S.INTERRUPTED
    assert bench.story() == ["sdk AVAILABLE", "REQUESTED", "INTERRUPTED"]


@pytest.mark.parametrize("hook", ["validate", "on_dispatch", "progress", "on_interrupt", "on_violation"])
def test_a_hook_that_raises_fails_its_execution_only(hook):
    def burst(_):
        raise RuntimeError("no\nlink to guidance")

    bench = Bench()
    bench.hooks["takeoff"].acts[hook] = burst
    execution = bench.run()
    bench.progress(execution)
    if hook == "on_violation":
        bench.engine.transition("sdk", "UNAVAILABLE")
        assert execution.state is S.RESOURCE_INVARIANT_VIOLATED  # it had ended
        assert "no\nlink to guidance" in bench.errors[0]
        return
    bench.engine.interrupt(execution.id)
    assert execution.state is S.FAILED
    assert execution.message == f"{hook} raised RuntimeError: no; link to guidance"
    assert bench.states()["axes"] == "AVAILABLE"
    assert bench.hooks["takeoff"].calls[-1] == {"validate": "validate", "on_interrupt": "on_interrupt"}.get(hook, "on_failure")
    bench.hooks["takeoff"].acts.clear()
    assert bench.run().state is S.RUNNING


def test_a_postcondition_that_is_false_fails():
    bench = Bench()
    execution = bench.run()
    execution.terminate("SAFE")
    assert execution.state is S.FAILED
    assert execution.message == "postcondition of takeoff SAFE is false: axes is AVAILABLE"


def test_an_unknown_output_fails():
    bench = Bench()
    execution = bench.run()
    execution.terminate("DONE", outputs={"nosuch": 1})
    assert execution.state is S.FAILED
    assert "no output nosuch" in execution.message


def test_preconditions_over_data_need_a_fresh_value():
    charged = Precondition("charged", Not(DataIs("battery", ("level",), Comparison.LE, 20, "%")))
    skill = flying_skill("takeoff", preconditions=(charged,))
    bench = Bench(flying_skillset(skill, data=(Data("battery", "Battery"),)))
    assert bench.run().message == "charged: battery has no fresh value"
    bench.engine.update_data("battery", SimpleNamespace(level=0.2))
    assert bench.run().message == "charged: battery.level is 0.2"
    bench.engine.update_data("battery", SimpleNamespace(level=0.3))
    assert bench.run().state is S.RUNNING


def test_models_that_cannot_be_executed_are_refused():
    over_data = DataIs("battery", (), Comparison.GT, 1.0)
    with pytest.raises(SkillRuntimeError, match="battery"):
        Bench(flying_skillset(flying_skill("takeoff", results=(Result("DONE", postcondition=over_data),))))
    with pytest.raises(SkillRuntimeError, match="battery"):
        Bench(flying_skillset(events=(Event("low", over_data),)))
    with pytest.raises(SkillRuntimeError, match="no hooks for takeoff"):
        SkillsetEngine(flying_skillset(), lambda: 0, {}, lambda _: None)
    with pytest.raises(SkillRuntimeError, match="no skill other"):
        SkillsetEngine(flying_skillset(), lambda: 0, {"takeoff": Recorder(), "other": Recorder()}, lambda _: None)


def test_close_fails_what_runs_and_refuses_what_comes():
    bench = Bench()
    execution = bench.run()
    bench.engine.close("shut down")
    assert (execution.state, execution.message) == (S.FAILED, "shut down")
    assert bench.hooks["takeoff"].calls[-1] == "on_failure"
    assert bench.run().state is S.NOT_VALIDATED


def test_hooks_are_never_called_with_the_lock_held():
    bench = Bench()

    def from_another_thread(_):
        other = threading.Thread(target=bench.engine.transition, args=("sdk", "NOSUCH"))
        other.start()
        other.join(HANGS_S)
        assert not other.is_alive()
        return ""

    for hook in ("validate", "on_dispatch", "on_interrupt"):
        bench.hooks["takeoff"].acts[hook] = from_another_thread
    bench.hooks["takeoff"].acts["progress"] = lambda execution: len(from_another_thread(execution))
    execution = bench.run()
    bench.progress(execution)
    bench.engine.interrupt(execution.id)
    assert execution.state is S.INTERRUPTED


def test_a_listener_that_raises_or_asks_back_does_no_harm():
    bench = Bench()
    told = []

    def listener(events):
        told.extend(event.sequence for event in events)
        bench.engine.transition("sdk", "NOSUCH")
        raise ValueError("listener")

    bench.engine._outbox._listener = listener
    bench.run().terminate("DONE")
    assert told == [2, 2, 3, 4, 3, 4, 5, 6, 5, 6]
    assert "listener" in bench.errors[0]
