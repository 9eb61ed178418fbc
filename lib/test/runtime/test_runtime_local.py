"""Executions without middleware, in virtual time: they behave as clients know it from ROS 2."""

from __future__ import annotations

import pytest
from runtime_local_rig import Timed, make

from alula.model.execution_state import ExecutionState
from alula.model.model import Progress
from alula.runtime.core import ExecutionEvent
from alula.runtime.local import LocalWorld
from alula_testing.recorder import Recorder
from alula_testing.runtime_models import flying_skill, flying_skillset

S = ExecutionState


def test_an_execution_goes_its_way_as_a_client_sees_it():
    world, client = make()
    handle = client.start("takeoff", height=3.0)
    assert (handle.state, handle.done, handle.outcome) == (S.REQUESTED, False, "")
    assert world.run_until(lambda: handle.state is S.RUNNING, timeout_s=0.0)
    world.run_for(0.55)
    assert handle.progress == pytest.approx(0.5)
    ended: list = []
    handle.add_done_callback(lambda handle: ended.append((handle.outcome, world.now_s, client.resources["axes"])))
    assert handle.wait(10.0)
    assert ended == [("TERMINATED", 1.0, "AVAILABLE")]
    assert (handle.result, handle.message, handle.outputs) == ("DONE", "there", {"reached": 2.5})
    handle.add_done_callback(lambda handle: ended.append(handle.id))
    assert ended[-1] == handle.id


def test_an_interruption_stops_the_function_and_gives_back_what_it_held():
    world, client = make()
    hooks = world.managers["flying"]._hooks["takeoff"]
    handle = client.start("takeoff", height=3.0)
    world.run_for(0.3)
    assert client.resources["axes"] == "USED"
    handle.interrupt()
    assert not handle.done
    assert handle.wait(1.0)
    assert (handle.outcome, world.now_s, client.resources["axes"]) == ("INTERRUPTED", 0.3, "AVAILABLE")
    assert hooks.stopped == [handle.id]


def test_an_extern_transition_breaks_an_invariant_at_once():
    world, client = make()
    handle = client.start("takeoff", height=3.0)
    world.run_for(0.3)
    assert client.transition("sdk", "UNAVAILABLE").get(1.0).accepted
    assert handle.wait(1.0)
    assert (handle.outcome, handle.result, world.now_s) == ("RESOURCE_INVARIANT_VIOLATED", "keep_sdk", 0.3)
    world.run_for(0.0)
    assert world.managers["flying"]._hooks["takeoff"].stopped == [handle.id]


def test_a_refused_transition_says_why():
    _, client = make()
    reply = client.transition("sdk", "AVAILABLE").get(1.0)
    assert not reply.accepted
    assert reply.reason == "resource sdk is AVAILABLE and has no extern transition AVAILABLE -> AVAILABLE"


def test_refusals_reach_the_caller():
    world, client = make()
    other = world.client("flying")
    assert other.wait_ready(0.0)
    first, second = client.start("takeoff", height=3.0), other.start("takeoff", height=4.0)
    assert second.wait(0.0)
    assert (second.outcome, second.result) == ("NOT_READY", "not_moving")
    assert first.wait(2.0)
    assert first.outcome == "TERMINATED"


def test_validate_refuses_in_its_own_words():
    hooks = Recorder()
    hooks.acts["validate"] = lambda inputs: f"{inputs.height:g} m is too high"
    world = LocalWorld()
    world.serve(flying_skillset(), {"takeoff": hooks})
    client = world.client("flying")
    assert client.wait_ready(0.0)
    handle = client.start("takeoff", height=300)
    assert handle.wait(0.0)
    assert (handle.outcome, handle.message) == ("NOT_VALIDATED", "300 m is too high")


def test_events_come_before_the_changes_that_they_tell_of_before_results():
    world, client = make()
    world.run_for(0.0)
    order: list[str] = []
    client.on_change(lambda resources: order.append(resources["axes"]))
    client.on_event(lambda event: order.append(event.state.value if isinstance(event, ExecutionEvent) else event.resource))
    handle = client.start("takeoff", height=3.0)
    handle.add_done_callback(lambda _: order.append("result"))
    handle.wait(2.0)
    assert order == ["REQUESTED", "axes", "USED", "RUNNING", "axes", "AVAILABLE", "TERMINATED", "result"]


def test_progress_comes_every_period_of_the_model_and_ends_with_the_execution():
    world, client = make()
    reports: list[float] = []
    handle = client.start("takeoff", height=3.0)
    run = handle.run
    handle.run = lambda progress, outputs=None: (reports.append((round(world.now_s, 3), round(progress, 3))), run(progress, outputs))
    assert handle.wait(5.0)
    world.run_for(5.0)
    assert reports == [(round(0.1 * n, 3), round(0.1 * n, 3)) for n in range(1, 10)]


def test_an_execution_that_stands_still_fails_at_its_deadline():
    skill = flying_skill("takeoff", progress=Progress(0.1, deadline_s=2.5))
    world, client = make(flying_skillset(skill), lambda _: {"takeoff": Recorder()})
    handle = client.start("takeoff", height=3.0)
    assert handle.wait(50.0)
    assert handle.outcome == "FAILED"
    assert world.now_s == pytest.approx(2.6)  # 0.5 at its first report is progress


def test_executions_pause_where_hooks_can_and_answers_come_the_way_of_messages():
    class Pausing(Timed):
        def on_pause(self, execution) -> str:
            return "" if execution.inputs.height < 5.0 else "too high to stop here"

        def on_resume(self, execution) -> str:
            return ""

    world, client = make(hooks=lambda managers: {"takeoff": Pausing(managers, 5.0)}, latency_s=0.1)
    handle = client.start("takeoff", height=3.0)
    world.run_for(0.5)
    begun_s = world.now_s
    assert handle.pause().get(1.0) == ""
    assert world.now_s - begun_s == pytest.approx(0.2)
    assert handle.state is S.PAUSED
    assert handle.resume().get(1.0) == ""
    assert handle.wait(10.0)
    assert handle.outcome == "TERMINATED"
    high = client.start("takeoff", height=6.0)
    world.run_for(0.5)
    assert high.pause().get(1.0) == "too high to stop here"


def test_a_stop_that_takes_too_long_is_an_emergency_at_its_deadline():
    class Slow(Timed):
        def on_interrupt(self, execution):
            return False  # it goes on stopping

        def on_emergency(self, execution) -> None:
            self.stopped.append("emergency")

    world, client = make(hooks=lambda managers: {"takeoff": Slow(managers, 100.0)})
    handle = client.start("takeoff", height=3.0)
    world.run_for(1.0)
    handle.interrupt()
    assert handle.wait(60.0)
    assert handle.outcome == "INTERRUPTED"
    assert world.now_s == pytest.approx(6.0)
    assert world.managers["flying"]._hooks["takeoff"].stopped == ["emergency"]
