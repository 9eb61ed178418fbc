"""What the panel shows and what its fields mean, without ROS and without a screen."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest

from alula.console.form import Field, FormError, fields, value_of, values
from alula.console.view import DataRow, ResourceRow, Running, SkillRow, SkillsetView, one_line
from alula.model.execution_state import ExecutionState
from alula.model.expressions import Comparison, DataIs, ResourceIs
from alula.model.model import Data as ModelData
from alula.model.model import Parameter, Precondition, Resource, Skill, Skillset, Transition
from alula.runtime.core.events import ExecutionEvent, TransitionEvent
from skill_panel.memory import Memory

FULL = DataIs("battery", ("percentage",), Comparison.GT, 0.2)
GO = Skill(
    "go",
    inputs=(Parameter("speed", "float64", comment="m/s"), Parameter("tries", "int64", default="3")),
    preconditions=(Precondition("open", ResourceIs("door", "OPEN")), Precondition("full", FULL)),
)
DOOR = Resource("door", ("SHUT", "OPEN"), "SHUT", (Transition("SHUT", "OPEN", extern=True), Transition("OPEN", "SHUT")))
MODEL = Skillset(
    "rover", data=(ModelData("battery", "Battery", 1.0), ModelData("odd", "Odd")), resources=(DOOR,), skills=(GO, Skill("wait"))
)


@pytest.fixture
def view():
    return SkillsetView("/rover", MODEL)


def execution(identifier: str, state: str, result: str = ""):
    return SimpleNamespace(id=identifier, state=ExecutionState(state), result=result)


def skills(**states):
    return {name: SimpleNamespace(open=open_ones, last=last[0] if last else None) for name, (open_ones, last) in states.items()}


def test_resources_have_the_extern_transitions_that_are_possible(view):
    assert view.resource_rows() == [ResourceRow("door", "?", (), ("OPEN",))]
    view.heard_states({"door": "SHUT"}, {})
    assert view.resource_rows() == [ResourceRow("door", "SHUT", ("OPEN",), ("OPEN",))]
    view.heard_states({"door": "OPEN"}, {"door": ""})
    assert view.resource_rows() == [ResourceRow("door", "OPEN", (), ("OPEN",))]  # SHUT is for skills


def test_why_a_resource_is_so_is_shown_with_it_and_with_what_asks_for_it(view):
    view.heard_states({"door": "SHUT"}, {"door": "not heard of for 4 s"})
    assert view.resource_rows() == [ResourceRow("door", "SHUT", ("OPEN",), ("OPEN",), "not heard of for 4 s")]
    assert view.skill_rows()[0].unmet[0].endswith("door is SHUT (door: not heard of for 4 s)")


def test_data_have_an_age_on_the_mission_clock(view):
    view.heard_data("battery", value_json='{"header": {"frame_id": ""}, "percentage": 0.123456}', stamp_ns=1_500_000_000, stale=False)
    assert view.data_rows(2_000_000_000) == [
        DataRow("battery", "percentage=0.1235", 0.5, stale=False),
        DataRow("odd", "nothing received", None, stale=True),
    ]


def test_why_not_follows_resources_and_data(view):
    assert view.skill_rows()[0].unmet == ("no states of the resources have been received yet",)
    view.heard_states({"door": "SHUT"}, {})
    row = view.skill_rows()[0]
    assert (row.status, len(row.unmet)) == ("not ready", 2)
    assert "door is SHUT" in row.unmet[0]
    assert "battery" in row.unmet[1]
    view.heard_states({"door": "OPEN"}, {"door": ""})
    battery = {"value_json": json.dumps({"percentage": 0.5}), "stamp_ns": 0}
    view.heard_data("battery", **battery, stale=False)
    assert view.skill_rows()[0] == SkillRow("go", (), "", ())
    view.heard_data("battery", **battery, stale=True)
    assert [reason.split(":")[0] for reason in view.skill_rows()[0].unmet] == ["full"]
    view.heard_heartbeat(alive=False)
    assert view.skill_rows()[0].unmet == ("the managers have gone",)


def test_skills_show_what_runs_and_how_it_ended(view):
    view.heard_states({"door": "OPEN"}, {"door": ""})
    view.heard_skills(skills(go=([execution("1", "RUNNING")], []), wait=([], [execution("0", "TERMINATED", "DONE")])))
    view.heard_progress("1", 0.5)
    view.heard_progress("9", 0.5)  # of no execution that is known
    go, wait = view.skill_rows()
    assert (go.running, go.status) == ((Running("1", "go", "RUNNING", 0.5),), "RUNNING")
    assert (wait.last, wait.status) == ("TERMINATED DONE", "ready")
    view.heard_skills(skills(go=([execution("1", "PAUSED"), execution("2", "REQUESTED")], []), wait=([], [])))
    go = view.skill_rows()[0]
    assert (go.status, go.running[0].progress) == ("PAUSED REQUESTED", 0.5)
    view.heard_heartbeat(alive=False)
    assert view.skill_rows()[0].running == ()


def test_the_log_and_the_version_follow_every_change(view):
    before = view.version
    stamp_ns = 12_340_000_000
    view.heard_event(ExecutionEvent(1, stamp_ns, "go", "0123456789ab", ExecutionState.NOT_READY, "open", "door is SHUT", None, {}))
    view.heard_event(TransitionEvent(2, stamp_ns, "door", "SHUT", "OPEN", "extern"))
    assert list(view.log) == ["12.34  go 012345 NOT_READY open: door is SHUT", "12.34  door SHUT -> OPEN by extern"]
    assert (view.logged, view.version) == (2, before + 2)
    view.heard_heartbeat(alive=True)  # nothing new
    assert view.logged == 2


def test_values_fit_on_a_line():
    assert one_line('{"data": 1.5}') == "1.5"
    assert one_line('{"a": [true, null, "x"], "b": {"c": 1}}') == "a=[true, None, x] b=c=1"
    assert one_line(json.dumps("x" * 99), width=10) == "x" * 9 + "…"


KINDS = {"speed": "float64", "tries": "int64"}


def test_fields_begin_with_what_was_last_used_or_the_models_default():
    assert [(field.text, field.label) for field in fields(GO, KINDS, {})] == [("0.0", "speed (float64, m/s)"), ("3", "tries (int64)")]
    made = fields(GO, KINDS, {"speed": "2.5", "gone": "1"})
    assert [field.text for field in made] == ["2.5", "3"]
    assert values(made, {"speed": " 1e-1 ", "tries": "4"}) == {"speed": 0.1, "tries": 4}


@pytest.mark.parametrize(
    ("name", "kind", "comment", "said"),
    [
        ("height", "float64", "< h_geo_fence", "m, < h_geo_fence"),  # the paper's takeoff
        ("speed", "float32", "", "m/s"),
        ("speed", "float64", "km/h, over the ground", "km/h, over the ground"),
        ("rate", "float64", "rad/s, > 0", "rad/s, > 0"),
        ("height", "string", "", ""),
        ("gain", "float64", "0 to 1", "0 to 1"),
    ],
)
def test_an_input_without_a_unit_in_its_comment_is_told_in_the_si_unit_of_its_name(name, kind, comment, said):
    skill = Skill("go", inputs=(Parameter(name, kind, comment=comment),))
    assert [field.said for field in fields(skill, {name: kind}, {})] == [said]


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("bool", "Yes", True),
        ("bool", "off", False),
        ("string", "1, 2", "1, 2"),
        ("geometry_msgs/Point", "1, 2, 3", [1, 2, 3]),
        ("geometry_msgs/Point", "{x: 1, y: 2.5}", {"x": 1, "y": 2.5}),
        ("float64[]", "[1, 2]", [1, 2]),
        ("float64[]", "[]", []),
        ("uint8", "7", 7),
    ],
)
def test_what_texts_mean(kind, text, value):
    assert value_of(Field("f", kind, "", ""), text) == value


@pytest.mark.parametrize(
    ("kind", "text", "said"),
    [
        ("float64", "fast", "f: 'fast' is no number"),
        ("int32", "1.5", "f: '1.5' is no whole number"),
        ("bool", "maybe", "f: write true or false, not 'maybe'"),
        ("geometry_msgs/Point", "here", "f: 'here' is no geometry_msgs/Point; write it as 1, 2, 3"),
        ("geometry_msgs/Pose", "{x", "f: '{x' is no geometry_msgs/Pose; write it as {field: value}"),
        ("float64[]", "7", r"f: '7' is no float64[]; write it as [1, 2]"),
    ],
)
def test_texts_that_mean_nothing_are_told_by_name(kind, text, said):
    with pytest.raises(FormError) as raised:
        value_of(Field("f", kind, "", ""), text)
    assert str(raised.value) == said


def test_inputs_are_remembered_and_a_damaged_memory_is_none(tmp_path):
    path = tmp_path / "deep" / "panel.json"
    Memory(path).keep("rover", "go", {"speed": "1"})
    assert Memory(path).texts("rover", "go") == {"speed": "1"}
    assert Memory(path).texts("rover", "wait") == {}
    for damage in ("{", "[]", '{"rover.go": 3}'):
        path.write_text(damage)
        assert Memory(path).texts("rover", "go") == {}
    Memory(tmp_path).keep("rover", "go", {})  # a folder: can't be written, and nothing happens
