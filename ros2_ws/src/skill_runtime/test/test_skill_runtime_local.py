"""The skillset interface without middleware: virtual time, and the behaviour that clients know from ROS 2."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skill_runtime_models import SDK, Recorder, flying_skill, flying_skillset

from skill_language.json_form import from_json
from skill_language.model import Assignment, Comparison, Data, DataIs, Effect, Event, Invariant, Parameter, Precondition, Progress
from skill_language.ros_types import parse_type
from skill_runtime.core import ExecutionEvent, ExecutionState
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.hooks import SkillHooks
from skill_runtime.local import LocalWorld, VirtualClock, WorldError, event_record
from skill_runtime.waiting import CannotWaitError, NoAnswerError

S = ExecutionState


class Timed(SkillHooks):
    """Ends with DONE after a while, if nobody stops it."""

    def __init__(self, managers, duration_s: float = 1.0) -> None:
        self.managers = managers
        self.duration_s = duration_s
        self.started_s: dict[str, float] = {}
        self.stopped: list[str] = []

    def on_dispatch(self, execution) -> None:
        self.started_s[execution.id] = self.managers.clock.now_s
        self.managers.after(self.duration_s, lambda: execution.terminate("DONE", "there", {"reached": 2.5}))

    def progress(self, execution) -> float:
        return (self.managers.clock.now_s - self.started_s[execution.id]) / self.duration_s

    def on_interrupt(self, execution) -> None:
        self.stopped.append(execution.id)


def timed(managers):
    return {skill.name: Timed(managers) for skill in managers.skillset.skills}


def make(skillset=None, hooks=timed, *, authority=True, **options):
    world = LocalWorld([skillset or flying_skillset()], hooks, **options)
    client = world.client("flying")
    assert client.wait_ready(1.0)
    if authority:
        assert client.transition("sdk", "AVAILABLE").get(1.0).accepted
    return world, client


def test_time_jumps_from_job_to_job_in_the_order_of_their_moments():
    clock, done = VirtualClock(start_s=10.0), []
    clock.after(2.0, lambda: done.append(("second", clock.now_s)))
    clock.after(1.0, lambda: clock.soon(lambda: done.append(("begotten", clock.now_s))))
    clock.after(1.0, lambda: done.append(("first", clock.now_s)))
    clock.after(1.5, lambda: done.append(("never", clock.now_s))).cancel()
    while clock.do_next(20 * 10**9):
        pass
    assert done == [("first", 11.0), ("begotten", 11.0), ("second", 12.0)]
    assert clock.now_s == 20.0


def test_a_moment_that_has_passed_is_now():
    clock = VirtualClock(start_s=5.0)
    assert clock.at(0, lambda: None).when_ns == 5 * 10**9


def test_jobs_that_beget_each_other_without_end_are_an_error():
    world = LocalWorld()

    def again() -> None:
        world.clock.soon(again)

    again()
    with pytest.raises(WorldError, match="time stands still at 0 s"):
        world.run_for(1.0)


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


def test_a_wait_is_bounded_by_the_mission_clock():
    world, client = make()
    handle = client.start("takeoff", height=3.0)
    assert not handle.wait(0.25)
    assert world.now_s == 0.25
    assert handle.state is S.RUNNING


def test_nothing_has_happened_when_start_returns_and_latency_delays_both_ways():
    world, client = make(latency_s=0.1)
    begun_s = world.now_s
    handle = client.start("takeoff", height=3.0)
    assert world.run_until(lambda: handle.state is S.RUNNING, timeout_s=5.0)
    assert world.now_s - begun_s == pytest.approx(0.2)


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


def test_refusals_reach_the_one_who_asked():
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


@pytest.mark.parametrize(
    ("skill", "inputs", "complaint"),
    [
        ("fly", {}, "skillset flying has no skill 'fly'; it has takeoff"),
        ("takeoff", {}, "inputs of flying.takeoff: height missing"),
        ("takeoff", {"height": 1.0, "depth": 2.0}, "inputs of flying.takeoff has no 'depth'; it has height"),
        ("takeoff", {"height": "high"}, "inputs of flying.takeoff, height takes a number (float64), not 'high'"),
        ("takeoff", {"height": True}, "inputs of flying.takeoff, height takes a number (float64), not True"),
    ],
)
def test_wrong_inputs_are_refused_before_anything_is_sent(skill, inputs, complaint):
    world, client = make()
    events: list = []
    world.on_event(lambda *event: events.append(event))
    world.run_for(0.0)
    before = len(events)
    with pytest.raises(ValueError) as error:  # noqa: PT011 - the whole text is compared
        client.start(skill, **inputs)
    assert str(error.value) == complaint
    world.run_for(1.0)
    assert len(events) == before


def test_inputs_reach_the_hooks_as_messages_would():
    inputs = (
        Parameter("target", "Point"),
        Parameter("ranges", "Ranges"),
        Parameter("way", "Path"),
        Parameter("tries", "uint8"),
        Parameter("label", "string"),
    )
    types = {name: parse_type(text) for name, text in (("Point", "geometry_msgs/Point"), ("Ranges", "float64[]"))}
    types["Path"] = parse_type("geometry_msgs/Point[]")
    seen: list = []
    hooks = Recorder()
    hooks.acts["on_dispatch"] = lambda execution: seen.append(execution.inputs)
    _, client = make(flying_skillset(flying_skill("takeoff", inputs=inputs)), lambda _: {"takeoff": hooks}, types=types)
    way = [{"x": 1.0, "y": 2.0, "z": 3.0}]
    handle = client.start("takeoff", target=(1, 2, 3), ranges=[1, 2, 3], way=way, tries=255, label="a")
    way[0]["x"] = 9.0
    handle.wait(0.0)
    (given,) = seen
    assert (given.target.x, given.target.y, given.target.z) == (1.0, 2.0, 3.0)
    assert given.ranges == [1.0, 2.0, 3.0]
    assert given.way[0].x == 1.0
    assert (given.tries, given.label) == (255, "a")
    for wrong, complaint in (({"tries": 256}, "from 0 to 255"), ({"label": 3}, "takes a string"), ({"ranges": 1}, "takes a list")):
        values = {"target": (1, 2, 3), "ranges": [], "way": [], "tries": 1, "label": "", **wrong}
        with pytest.raises(ValueError, match=complaint):
            client.start("takeoff", **values)


def test_managers_that_are_not_there_or_have_gone_leave_nobody_waiting():
    world = LocalWorld()
    client = world.client("flying")
    assert not client.wait_ready(3.0)
    assert world.now_s == 3.0
    stillborn = client.start("takeoff", height=3.0)
    assert (stillborn.outcome, stillborn.message) == ("FAILED", "the managers of flying are not there")
    with pytest.raises(RuntimeError, match="call wait_ready first"):
        _ = client.model
    world.serve(flying_skillset(), timed)
    assert client.wait_ready(0.0)
    assert client.transition("sdk", "AVAILABLE").get(1.0).accepted
    handle = client.start("takeoff", height=3.0)
    world.run_for(0.5)
    world.kill("flying")
    assert handle.wait(0.0)
    assert (handle.outcome, handle.message) == ("FAILED", "the managers of flying have gone")
    assert not client.ready
    assert client.start("takeoff", height=3.0).outcome == "FAILED"
    world.serve(flying_skillset(), timed)
    assert client.wait_ready(0.0)
    assert client.resources == {"sdk": "UNAVAILABLE", "axes": "AVAILABLE"}
    with pytest.raises(WorldError, match="already"):
        world.serve(flying_skillset(), timed)


def test_a_start_on_its_way_to_managers_that_die_fails():
    world, client = make(latency_s=0.1)
    handle = client.start("takeoff", height=3.0)
    world.kill("flying")
    assert handle.wait(1.0)
    assert handle.outcome == "FAILED"


def test_managers_that_are_shut_down_say_so():
    world, client = make()
    handle = client.start("takeoff", height=3.0)
    world.run_for(0.1)
    world.managers["flying"].close("the managers were shut down")
    late = client.start("takeoff", height=3.0)
    assert handle.wait(0.0)
    assert late.wait(0.0)
    assert (handle.outcome, handle.message) == ("FAILED", "the managers were shut down")
    assert (late.outcome, late.message) == ("NOT_VALIDATED", "the managers were shut down")


def test_a_callback_of_hooks_that_raises_fails_what_runs_and_the_managers_live_on():
    class Raising(Timed):
        def on_dispatch(self, execution) -> None:
            super().on_dispatch(execution)
            self.managers.after(0.5, lambda: 1 / 0)

    world, client = make(hooks=lambda managers: {"takeoff": Raising(managers)})
    handle = client.start("takeoff", height=3.0)
    assert handle.wait(2.0)
    assert (handle.outcome, handle.message) == ("FAILED", "a callback raised ZeroDivisionError: division by zero")
    assert len(world.errors) == 1
    again = client.start("takeoff", height=3.0)
    world.run_for(0.1)
    assert again.state is S.RUNNING


def test_a_late_client_is_told_what_latched_topics_hold():
    world, client = make()
    assert client.start("takeoff", height=3.0).wait(2.0)
    late, events, changes = world.client("flying"), [], []
    late.on_event(lambda skillset, event: events.append((skillset, event.sequence)))
    late.on_change(changes.append)
    assert late.resources == {}
    assert late.wait_ready(0.0)
    assert changes == [{"sdk": "AVAILABLE", "axes": "AVAILABLE"}]
    assert events == [("flying", number) for number in range(1, 7)]


def test_changes_come_before_events_before_results():
    world, client = make()
    world.run_for(0.0)
    order: list[str] = []
    client.on_change(lambda resources: order.append(resources["axes"]))
    client.on_event(lambda _, event: order.append(event.state.value if isinstance(event, ExecutionEvent) else event.resource))
    handle = client.start("takeoff", height=3.0)
    handle.add_done_callback(lambda _: order.append("result"))
    handle.wait(2.0)
    assert order == ["REQUESTED", "USED", "axes", "RUNNING", "AVAILABLE", "axes", "TERMINATED", "result"]


def test_waiting_inside_a_job_is_an_error_and_no_deadlock():
    world, client = make()
    complaints: list[str] = []

    def wait_there(handle) -> None:
        try:
            client.start("takeoff", height=3.0).wait(1.0)
        except CannotWaitError as error:
            complaints.append(str(error))

    client.start("takeoff", height=3.0).add_done_callback(wait_there)
    world.run_for(2.0)
    assert complaints == ["the world runs already: a job can't wait for it; use add_done_callback or on_change there"]


def test_progress_comes_every_period_of_the_model_and_ends_with_the_execution():
    world, client = make()
    reports: list[float] = []
    handle = client.start("takeoff", height=3.0)
    run = handle.run
    handle.run = lambda progress, outputs=None: (reports.append((round(world.now_s, 3), round(progress, 3))), run(progress, outputs))
    assert handle.wait(5.0)
    world.run_for(5.0)
    assert reports == [(round(0.1 * n, 3), round(0.1 * n, 3)) for n in range(1, 10)]


def test_data_are_fresh_until_three_periods_have_passed():
    charged = Precondition("charged", DataIs("battery", (), Comparison.GT, 0.2))
    skillset = flying_skillset(flying_skill("takeoff", preconditions=(charged,)), data=(Data("battery", "float64", period_s=1.0),))
    world, client = make(skillset)
    values: list = []
    client.data_feed("battery").on_sample(lambda sample: values.append(sample.value))
    assert not client.get_data("nosuch").known
    assert not client.get_data("battery").received
    blind = client.start("takeoff", height=3.0)
    assert blind.wait(0.0)
    assert (blind.outcome, blind.message) == ("NOT_READY", "charged: battery has no fresh value")
    world.managers["flying"].publish("battery", 0.5)
    world.run_for(3.0)
    reading = client.get_data("battery")
    assert (reading.received, reading.stale, reading.value, reading.stamp_ns) == (True, False, 0.5, 0)
    assert client.start("takeoff", height=3.0).wait(5.0)
    world.run_for(0.1)
    assert client.get_data("battery").stale
    assert values == [0.5]
    with pytest.raises(KeyError, match="no data nosuch; it has battery"):
        world.managers["flying"].publish("nosuch", 1)


def test_an_invariant_over_data_is_broken_by_a_value_or_by_silence():
    full = Invariant("charged", DataIs("battery", (), Comparison.GT, 0.2))
    skill = flying_skill("takeoff", invariants=(full,))
    skillset = flying_skillset(skill, data=(Data("battery", "float64", period_s=1.0),))
    for silence in (False, True):
        world, client = make(skillset, lambda managers: {"takeoff": Timed(managers, 100.0)})
        world.managers["flying"].publish("battery", 0.5)
        handle = client.start("takeoff", height=3.0)
        world.run_for(2.0)
        if not silence:
            world.managers["flying"].publish("battery", 0.1)
        assert handle.wait(50.0)
        assert (handle.outcome, handle.result) == ("RESOURCE_INVARIANT_VIOLATED", "charged")
        assert world.now_s == pytest.approx(3.0 if silence else 2.0, abs=1e-6)


def test_an_execution_that_stands_still_fails_at_its_deadline():
    skill = flying_skill("takeoff", progress=Progress(0.1, deadline_s=2.5))
    world, client = make(flying_skillset(skill), lambda _: {"takeoff": Recorder()})
    handle = client.start("takeoff", height=3.0)
    assert handle.wait(50.0)
    assert handle.outcome == "FAILED"
    assert world.now_s == pytest.approx(2.6)  # 0.5 at its first report is progress


def test_an_event_of_the_model_is_taken_or_refused():
    calm = Event("calm", guard=SDK, effect=Effect("free", (Assignment("axes", "AVAILABLE"),)))
    world, client = make(flying_skillset(events=(calm,)))
    handle = client.start("takeoff", height=3.0)
    world.run_for(0.1)
    assert client.trigger("calm").get(1.0).accepted
    assert handle.wait(0.0)
    assert (handle.outcome, handle.result) == ("RESOURCE_INVARIANT_VIOLATED", "in_control")
    assert not client.trigger("nosuch").get(1.0).accepted
    world.kill("flying")
    world.run_for(0.0)
    for answer in (client.trigger("calm"), client.transition("sdk", "AVAILABLE"), client.why("takeoff")):
        with pytest.raises(NoAnswerError, match="the managers of flying are not there"):
            answer.get(1.0)


def test_missing_outputs_are_as_in_an_empty_message():
    def hooks(managers):
        recorder = Recorder()
        recorder.acts["on_dispatch"] = lambda execution: execution.terminate("DONE")
        return {"takeoff": recorder}

    _, client = make(hooks=hooks)
    handle = client.start("takeoff", height=3.0)
    assert handle.wait(0.0)
    assert handle.outputs == {"reached": 0.0}


def test_managers_describe_themselves():
    world, client = make()
    assert from_json(world.managers["flying"].describe()).skills == client.model.skills


def test_hooks_must_fit_the_model():
    with pytest.raises(SkillRuntimeError, match="no hooks for takeoff"):
        LocalWorld([flying_skillset()], lambda _: {})
    with pytest.raises(WorldError, match="no hooks"):
        LocalWorld([flying_skillset()])


def test_records_are_those_of_the_event_messages():
    _, client = make()
    records: list = []
    client.on_event(lambda skillset, event: records.append(event_record(skillset, event)))
    assert client.start("takeoff", height=3.0).wait(2.0)
    requested, taken = records[0], records[1]
    assert json.loads(json.dumps(requested)) == {
        "stamp_s": 0.0,
        "sequence": 2,
        "skillset": "flying",
        "kind": "EXECUTION",
        "skill": "takeoff",
        "id": "000000000001",
        "state": "REQUESTED",
        "result": "",
        "message": "",
        "inputs": {"height": 3.0},
        "outputs": {},
    }
    assert set(taken) == {"stamp_s", "sequence", "skillset", "kind", "resource", "from_state", "to_state", "cause"}
    assert records[-1]["outputs"] == {"reached": 2.5}


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


def test_why_and_the_last_end_are_known_to_a_late_client():
    world, client = make()
    assert client.last("takeoff") is None
    first = client.start("takeoff", height=3.0)
    assert first.wait(5.0)
    running = client.start("takeoff", height=3.0)
    late = world.client("flying")
    assert late.wait_ready(0.0)
    last = late.last("takeoff")
    assert (last.id, last.outcome, last.result, last.outputs) == (first.id, "TERMINATED", "DONE", {"reached": 2.5})
    answer = late.why("takeoff").get(1.0)
    assert (answer.ready, [unmet.name for unmet in answer.unmet]) == (False, ["not_moving"])
    running.interrupt()
    assert running.wait(1.0)
    assert late.why("takeoff", {"height": 1.0}).get(1.0).ready
    assert late.last("takeoff").outcome == "INTERRUPTED"
    with pytest.raises(ValueError, match="no skill 'fly'"):
        late.why("fly")


def test_coroutines_run_in_virtual_time():
    world, client = make()

    async def mission() -> list[object]:
        first = await client.start("takeoff", height=3.0)
        reports = [report async for report in client.start("takeoff", height=4.0)]
        taken = await client.transition("sdk", "UNAVAILABLE")
        return [first.result, reports[-2].progress, reports[-1].state, taken.accepted, world.now_s]

    result, progress, state, accepted, now_s = world.run(mission())
    assert (result, progress, state, accepted, now_s) == ("DONE", pytest.approx(0.9), S.TERMINATED, True, 2.0)

    async def endless() -> None:
        await client.moment()

    with pytest.raises(WorldError, match="has not ended within 5 s"):
        world.run(endless(), timeout_s=5.0)


def test_the_views_of_the_typed_clients_fit():
    skillset = flying_skillset(data=(Data("battery", "float64", period_s=1.0),))
    world, client = make(skillset, authority=False)
    flying = client.view
    assert flying.sdk.transition("AVAILABLE").get(1.0).accepted
    assert flying.sdk.state == "AVAILABLE"
    used = flying.axes.becomes("USED")
    handle = flying.takeoff(height=3.0)
    assert used.get(1.0) == "USED"
    assert [report.state for report in handle][-1] is S.TERMINATED
    value = flying.data.battery.next()
    world.clock.after(2.0, lambda: world.managers["flying"].publish("battery", 0.5))
    assert value.get(5.0) == 0.5
    assert (flying.data.battery.value, flying.data.battery.stamp, flying.data.battery.stale) == (0.5, 3.0, False)
    gone = flying.axes.becomes("GONE")
    world.kill("flying")
    with pytest.raises(NoAnswerError, match="have gone"):
        gone.get(1.0)


def test_who_waits_for_what_can_not_come_is_told():
    _, client = make(hooks=lambda _: {"takeoff": Recorder()}, skillset=flying_skillset(flying_skill("takeoff", progress=None)))
    handle = client.start("takeoff", height=3.0)
    with pytest.raises(CannotWaitError, match="nothing can happen in this world any more"):
        list(handle)


def test_several_skillsets_share_a_clock_and_nothing_else():
    first, second = flying_skillset(), replace(flying_skillset(), name="gliding")
    world = LocalWorld([first, second], timed)
    clients = [world.client(name) for name in ("flying", "gliding")]
    assert all(client.wait_ready(0.0) for client in clients)
    assert clients[0].transition("sdk", "AVAILABLE").get(1.0).accepted
    handles = [client.start("takeoff", height=3.0) for client in clients]
    assert all(handle.wait(2.0) for handle in handles)
    assert [handle.outcome for handle in handles] == ["TERMINATED", "NOT_READY"]
    assert {len(handle.id) for handle in handles} == {12}


def test_no_ros_is_needed():
    code = "import sys, skill_runtime.local; assert not {m for m in sys.modules if m.startswith(('rclpy', 'rospy', 'rosidl'))}"
    subprocess.run([sys.executable, "-c", code], check=True)


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("start"), st.integers(0, 1)),
        st.tuples(st.just("interrupt"), st.integers(0, 5)),
        st.tuples(st.just("sdk"), st.sampled_from(["AVAILABLE", "UNAVAILABLE"])),
        st.tuples(st.just("pass"), st.floats(0.0, 1.5)),
        st.tuples(st.just("restart"), st.just(0)),
    ),
    max_size=20,
)


def play(steps, latency_s: float):
    """Run a script; return the events, and the handles."""
    world, _ = make(latency_s=latency_s)
    clients = [world.client("flying") for _ in range(2)]
    story, handles = [], []
    for name in world.managers:
        world.client(name).on_event(lambda skillset, event: story.append(event_record(skillset, event)))
    for what, value in steps:
        if what == "start":
            handles.append(clients[value].start("takeoff", height=3.0))
        elif what == "interrupt" and value < len(handles):
            handles[value].interrupt()
        elif what == "sdk":
            clients[0].transition("sdk", value)
        elif what == "pass":
            world.run_for(value)
        elif what == "restart":
            world.kill("flying")
            world.serve(flying_skillset(), timed)
    world.run_for(10.0)
    return story, handles


@settings(max_examples=60, deadline=None)
@given(STEPS, st.sampled_from([0.0, 0.01, 0.3]))
def test_whatever_is_asked_for_each_execution_ends_once_and_the_same_script_gives_the_same_story(steps, latency_s):
    story, handles = play(steps, latency_s)
    assert all(handle.done for handle in handles)
    ends = [(record["id"], record["sequence"]) for record in story if record["kind"] == "EXECUTION" and S(record["state"]).terminal]
    restarts = sum(what == "restart" for what, _ in steps)
    assert len({identifier for identifier, _ in ends}) == len(ends) or restarts
    again, same = play(steps, latency_s)
    assert again == story
    assert [(h.outcome, h.result, h.message) for h in same] == [(h.outcome, h.result, h.message) for h in handles]
