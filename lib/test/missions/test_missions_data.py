"""Conditions of a mission over data: fields in SI units, and what they answer where no fresh value is at hand."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("py_trees")

from alula.check.findings import findings_of
from alula.common.record import DATA, TREE, read_record
from alula.common.robots import load_robot_folder
from alula.language.messages import Messages, fields_of, messages_of
from alula.language.models import ModelFile, check_texts
from alula.missions.director import MissionResult, Outcome
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import MockedMission
from alula.missions.part import NO_PART
from alula.mock import load_behaviour
from alula.model.ros_types import RosType
from alula.trees.script import parse
from alula.trees.script.scope import Unknown
from alula_testing.battery import BATTERY, make_robot

MODEL = """
type Battery
skillset rover {
  data battery: Battery period 1 sec
  data mode: string
  data level: float64 period 1 sec
  resource wheels { state { FREE USED } initial FREE transition { FREE -> USED USED -> FREE } }
  skill drive { success ARRIVED {} }
}
"""
MOCK = """
skills: {rover.drive: {delay: 4}}
data:
  rover.battery: {period: 1, values: {0: {level: 0.8, volts: .nan}, 3: {level: 0.1, volts: 11.5}, 5: null}}
  rover.mode: {values: {0: '"AUTO"'}, period: 1}
"""


def walk(view):
    yield view
    for child in view["children"]:
        yield from walk(child)


def skillsets():
    (file,) = check_texts([ModelFile("rover.rl", MODEL)])
    assert [one for one in file.findings if one.severity.value == "error"] == []
    return file.skillsets


def text_of(body: str, ready: str = "<AlwaysSuccess/>") -> str:
    ports = '<TreeNodesModel><SubTree ID="m"><output_port name="seen" default="0"/></SubTree></TreeNodesModel>'
    trees = f'<BehaviorTree ID="m">{body}</BehaviorTree><BehaviorTree ID="ready">{ready}</BehaviorTree>'
    return f'<root BTCPP_format="4" main_tree_to_execute="m">{trees}{ports}</root>'


def flown(body: str, folder: Path, *, recorded: bool = True, ready: str = "<AlwaysSuccess/>") -> MissionResult:
    (folder / "m.xml").write_text(text_of(body, ready), encoding="utf-8")
    (folder / "mock.yaml").write_text(MOCK, encoding="utf-8")
    (folder / "run").mkdir()
    models = skillsets()
    plan = plan_of_file(folder / "m.xml", "m", models, {}, NO_PART)
    behaviour = load_behaviour([folder / "mock.yaml"], models)
    return MockedMission(models, behaviour, plan, out=folder / "run" if recorded else None).run()


def after(seconds: float, condition: str) -> str:
    return f'<Sequence><Sleep msec="{seconds * 1000:.0f}"/><ScriptCondition name="asked" code="{condition}"/></Sequence>'


@pytest.mark.parametrize(
    ("seconds", "condition", "holds"),
    [
        (1, "rover.battery.level &gt; 0.2", True),
        (4, "rover.battery.level &gt; 0.2", False),
        (4, "rover.battery.level &lt;= 0.1 &amp;&amp; rover.battery.volts &lt; 12", True),
        (1, "rover.mode == 'AUTO'", True),
        (1, "fresh(rover.battery) &amp;&amp; !fresh(rover.level)", True),
        # No number was measured, none ever came, and the last one is older than three periods.
        (1, "rover.battery.volts &gt; 0", False),
        (1, "!(rover.battery.volts &gt; 0)", False),
        (1, "rover.level &lt; 2", False),
        (6, "rover.battery.level &lt; 0.2", True),
        (9, "rover.battery.level &lt; 0.2", False),
        (9, "rover.battery.level &gt;= 0.2", False),
        (9, "rover.battery.level &gt;= 0.2 || rover.wheels == FREE", True),
        (9, "!(rover.battery.level &gt;= 0.2 &amp;&amp; rover.wheels == USED)", True),
        (9, "!fresh(rover.battery)", True),
        (1, "rover.battery.colour == 1", False),
    ],
)
@pytest.mark.parametrize("recorded", [True, False])
def test_a_condition_over_data_holds_while_a_fresh_value_says_so(seconds, condition, holds, recorded, tmp_path):
    end = flown(after(seconds, condition), tmp_path, recorded=recorded)
    assert end.outcome is (Outcome.ACCOMPLISHED if holds else Outcome.GIVEN_UP)


def test_the_tree_says_that_nobody_knows(tmp_path):
    flown(after(9, "rover.battery.level &lt; 0.2"), tmp_path)
    *_, last = (entry.value for entry in read_record(tmp_path / "run") if entry.topic == TREE)
    assert [one["message"] for one in walk(last) if one["name"] == "asked"] == ["rover.battery has no fresh value"]


def test_a_wait_for_data_ends_with_the_value_and_every_value_is_recorded(tmp_path):
    assert flown('<WaitFor if="rover.battery.level &lt; 0.2"/>', tmp_path).outcome is Outcome.ACCOMPLISHED
    data = [entry.value for entry in read_record(tmp_path / "run") if entry.topic == DATA]
    values = [one["value"]["level"] for one in data if one["data"] == "battery"]
    assert values[-1] == 0.1
    assert 0.8 in values


def test_a_mission_begins_when_the_data_that_it_needs_are_told(tmp_path):
    needs = '<Needs name="told" if="fresh(rover.battery)" otherwise="\'nothing is told\'"/>'  # asked before the managers were heard of, too
    assert flown('<ScriptCondition code="fresh(rover.battery)"/>', tmp_path, ready=needs).outcome is Outcome.ACCOMPLISHED


def test_data_end_a_skill_by_an_attribute(tmp_path):
    body = '<Fallback><rover.drive _while="rover.battery.level &gt; 0.2"/><ScriptCondition code="rover.battery.level &lt; 0.2"/></Fallback>'
    # A guard whose condition no longer holds halts the skill, and the node is SKIPPED.
    assert flown(body, tmp_path).outcome is Outcome.ACCOMPLISHED


class Unheard:
    """Nothing was heard of any name."""

    def __init__(self) -> None:
        self.enums = {}

    def get(self, name):
        return Unknown(f"{name} has no fresh value")


@pytest.mark.parametrize(
    ("script", "value"),
    [
        ("u && 0", 0.0),
        ("0 && u", 0.0),
        ("u || 1", 1.0),
        ("1 || u", 1.0),
        ("u < 1 < 0", 0.0),
        ("u && 1", None),
        ("u || 0", None),
        ("!u", None),
        ("-u", None),
        ("u + 1 < 2", None),
        ("u == u", None),
        ("u != 'A'", None),
        ("u ? 1 : 2", None),
    ],
)
def test_the_unknown_stays_unknown_unless_another_operand_decides(script, value):
    answer = parse(script).run(Unheard())
    assert answer == (Unknown("u has no fresh value") if value is None else value)


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("rover.battery.level &lt; 0.2", ""),
        ("rover.level &lt; 0.2", ""),
        ("fresh(rover.level)", ""),
        ("rover.batery.level &lt; 0.2", "has no resource and no data `batery.level`"),
        ("rover.battery &lt; 0.2", "`rover.battery` is no single value"),
        ("rover.level.value &lt; 0.2", "`rover.level` has no fields"),
        ("fresh(rover.wheels)", "there is no data `rover.wheels`"),
        ("seen := rover.level", "`rover.level` may have no fresh value here"),
        ("seen := (fresh(rover.level) ? 1 : 0)", ""),
    ],
)
def test_the_checker_knows_data(code, said):
    tag = "Script" if ":=" in code else "ScriptCondition"
    found = findings_of("m.xml", text_of(f'<{tag} code="{code}"/>').encode(), skillsets())
    assert [one.code for one in found] == (["ALU615"] if said else [])
    assert all(said in one.message for one in found)


@pytest.fixture
def messages(tmp_path):
    """The message of the battery as a package of the robot's workspace has it."""
    return messages_of(load_robot_folder(make_robot(tmp_path)))


@pytest.mark.parametrize(
    ("condition", "code", "said", "cure"),
    [
        ("rover.battery.level &lt; 0.2", "", "", ""),
        ("rover.battery.first.volts &lt; 3", "", "", ""),
        ("rover.battery.maker == 'none'", "", "", ""),
        ("rover.battery.charging == true", "", "", ""),
        ("rover.battery.charging", "", "", ""),
        ("rover.battery.state == 1", "", "", ""),
        ("rover.battery.other.anything &lt; 3", "", "", ""),  # there is no file of that message
        ("rover.battery.lvel &lt; 0.2", "ALU615", "rover_msgs/Battery has no field `lvel`", "did you mean `level`?"),
        ("rover.battery.CHARGING == 1", "ALU615", "has no field `CHARGING`", "did you mean `charging`?"),
        ("rover.battery.first.amps &lt; 3", "ALU615", "rover_msgs/Cell has no field `amps`", "there is `volts`"),
        ("rover.battery.level.value &lt; 3", "ALU615", "float64 has no fields", ""),
        ("rover.battery.first == 3", "ALU615", "`rover.battery.first` is no single value", "name a field"),
        ("rover.battery.all == 3", "ALU615", "`rover.battery.all` is no single value", "name a field"),
        ("rover.battery.all.volts == 3", "ALU615", "rover_msgs/Cell[] has no fields", ""),
        (
            "rover.battery.level == '0.2 m'",
            "ALU605",
            "is a number, and is compared with '0.2 m'",
            "in the data's unit",
        ),
        ("rover.battery.charging == 'yes'", "ALU605", "is true or false, and is compared with 'yes'", ""),
        ("3 &lt; rover.battery.maker", "ALU605", "`rover.battery.maker` is a text, and is compared with 3", "a text"),
        ("rover.battery.state == FREE", "ALU605", "is data, and `FREE` is a resource's state", "quotes"),
        ("rover.mode == 1", "ALU605", "`rover.mode` is a text, and is compared with 1", "a text"),
        ("rover.level == 'low'", "ALU605", "`rover.level` is a number", ""),
    ],
)
def test_the_checker_knows_the_fields_of_messages(condition, code, said, cure, messages):
    found = findings_of("m.xml", text_of(f'<ScriptCondition code="{condition}"/>').encode(), skillsets(), messages=messages)
    assert [one.code for one in found] == ([code] if code else [])
    for one in found:
        assert said in one.message
        assert cure in one.hint
        assert one.span.line == 1


def test_a_definition_of_a_message_is_read_as_ros_reads_it():
    fields = fields_of(BATTERY, "rover_msgs")
    assert fields["header"] == RosType("std_msgs", "Header")
    assert fields["all"] == RosType("rover_msgs", "Cell", array=True)
    assert fields["maker"] == RosType("", "string")
    assert (fields["cells"], "CHARGING" in fields, "none" in fields) == (None, False, False)


@pytest.mark.parametrize("garbage", ["\x00\xff", "float64", "= = =", "a/b/c d", "../etc x", "float64 x\r\n" * 3])
def test_a_definition_that_is_none_says_nothing(garbage):
    assert set(fields_of(garbage, "rover_msgs")) <= {"x", "d"}
    assert Messages({}).field("Battery", ["level"]) is None
