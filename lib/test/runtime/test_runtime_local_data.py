"""Inputs, outputs, data and events without middleware, and the views of typed clients on them."""

from __future__ import annotations

import json

import pytest
from runtime_local_rig import Timed, make

from alula.model.execution_state import ExecutionState
from alula.model.expressions import Comparison, DataIs
from alula.model.model import Assignment, Data, Effect, Event, Invariant, Parameter, Precondition
from alula.model.ros_types import parse_type
from alula.runtime.core.events import event_record
from alula.runtime.waiting import NoResponseError
from alula_testing.recorder import Recorder
from alula_testing.runtime_models import SDK, flying_skill, flying_skillset


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


def test_data_are_fresh_until_three_periods_have_passed():
    charged = Precondition("charged", DataIs("battery", (), Comparison.GT, 0.2))
    skillset = flying_skillset(flying_skill("takeoff", preconditions=(charged,)), data=(Data("battery", "float64", period_s=1.0),))
    world, client = make(skillset)
    values: list = []
    client.data_feed("battery").on_sample(lambda sample: values.append(sample.value))
    assert not client.read_data("nosuch").get(1.0).known
    assert not client.read_data("battery").get(1.0).received
    blind = client.start("takeoff", height=3.0)
    assert blind.wait(0.0)
    assert (blind.outcome, blind.message) == ("NOT_READY", "charged: battery has no fresh value")
    world.managers["flying"].publish("battery", 0.5)
    world.run_for(3.0)
    reading = client.read_data("battery").get(1.0)
    assert (reading.received, reading.stale, reading.value, reading.stamp_ns) == (True, False, 0.5, 0)
    assert client.start("takeoff", height=3.0).wait(5.0)
    world.run_for(0.1)
    assert client.read_data("battery").get(1.0).stale
    assert values == [0.5]
    with pytest.raises(KeyError, match="no data nosuch; it has battery"):
        world.managers["flying"].publish("nosuch", 1)


def test_of_values_that_come_too_soon_one_after_the_other_some_are_left_out():
    world, client = make(flying_skillset(flying_skill("takeoff"), data=(Data("battery", "float64"),)))
    values: list = []
    client.data_feed("battery", every_s=1.0).on_sample(lambda sample: values.append((sample.value, sample.stamp_ns)))
    for number in range(25):
        world.managers["flying"].publish("battery", number)
        world.run_for(0.1)
    assert values == [(number, number * 100_000_000) for number in (0, 10, 20)]


def test_a_data_that_no_condition_asks_for_makes_no_step():
    asked = Precondition("charged", DataIs("battery", (), Comparison.GT, 0.2))
    data = (Data("battery", "float64"), Data("heat", "float64"))
    world, client = make(flying_skillset(flying_skill("takeoff", preconditions=(asked,)), data=data))
    engine = world.managers["flying"].engine
    steps: list = []
    commit = engine._context.commit
    engine._context.commit = lambda *step, **more: steps.append(step) or commit(*step, **more)
    world.managers["flying"].publish("heat", 40.0)
    assert steps == []
    assert client.read_data("heat").get(1.0).value == 40.0
    world.managers["flying"].publish("battery", 0.5)
    assert len(steps) == 1


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
        with pytest.raises(NoResponseError, match="the managers of flying are not there"):
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


def test_records_are_those_of_the_event_messages():
    _, client = make()
    records: list = []
    client.on_event(lambda event: records.append(event_record(event)))
    assert client.start("takeoff", height=3.0).wait(2.0)
    requested, taken = records[0], records[1]
    assert json.loads(json.dumps(requested)) == {
        "stamp_s": 0.0,
        "instance_id": "000000000001",
        "sequence": 2,
        "skillset": "flying",
        "kind": "EXECUTION",
        "skill": "takeoff",
        "id": "000000000002",
        "state": "REQUESTED",
        "result": "",
        "result_kind": "",
        "unmet": [],
        "message": "",
        "inputs": {"height": 3.0},
        "outputs": {},
    }
    common = {"stamp_s", "instance_id", "sequence", "skillset", "kind"}
    assert set(taken) == {*common, "resource", "from_state", "to_state", "cause", "reason"}
    assert records[-1]["outputs"] == {"reached": 2.5}


def test_the_views_of_the_typed_clients_fit():
    skillset = flying_skillset(data=(Data("battery", "float64", period_s=1.0),))
    world, client = make(skillset, authority=False)
    flying = client.view
    assert flying.sdk.transition("AVAILABLE").get(1.0).accepted
    assert flying.sdk.state == "AVAILABLE"
    used = flying.axes.becomes("USED")
    handle = flying.takeoff(height=3.0)
    assert used.get(1.0) == "USED"
    assert [report.state for report in handle][-1] is ExecutionState.TERMINATED
    value = flying.data.battery.next()
    world.clock.after(2.0, lambda: world.managers["flying"].publish("battery", 0.5))
    assert value.get(5.0) == 0.5
    assert (flying.data.battery.value, flying.data.battery.stamp, flying.data.battery.stale) == (0.5, 3.0, False)
    gone = flying.axes.becomes("GONE")
    world.kill("flying")
    with pytest.raises(NoResponseError, match="have gone"):
        gone.get(1.0)
