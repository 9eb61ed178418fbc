"""Missions in the editor: findings on every change, completion, and what a name stands for."""

from __future__ import annotations

import pytest
from test_editor_server import Editor

from alula.editor.completion import Place
from alula.editor.missions import Missions
from alula.language.errors import Severity
from alula_testing.waits import HANGS_S
from finding_pages.mission_checks import ROBOT, whole


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "robot.yaml").write_text("name: drone\nskillsets: skillsets\n")
    (tmp_path / "skillsets").mkdir()
    (tmp_path / "skillsets" / "drone.rl").write_text(ROBOT)
    (tmp_path / "missions").mkdir()
    return tmp_path


def completed(folder, line):
    """Return what is offered at the place of a `|` in a line of a mission."""
    missions = Missions()
    before, _, after = line.partition("|")
    text = whole(before + after)
    file = missions.checked(str(folder / "missions" / "m.xml"), text)
    place = Place(3, len(f"    {before}") + 1)
    return {one.label: one.detail for one in missions.completions(file, place)}


def test_tags_are_skills_and_nodes(folder):
    offered = completed(folder, "<dro|")
    assert {"drone.hover", "drone.turn", "drone.watch", "Sequence", "Parallel"} <= set(offered)


def test_attributes_are_ports_that_are_not_given(folder):
    offered = completed(folder, '<drone.hover outcome="{why}" |/>')
    assert "s" in offered["duration"]
    assert {"duration", "success", "_skipIf"} <= set(offered)
    assert "outcome" not in offered


def test_values_are_results_and_names_of_scripts(folder):
    assert set(completed(folder, '<drone.hover duration="1" success="|"/>')) == {"DONE", "ABORTED"}
    assert set(completed(folder, '<ScriptCondition code="1 &lt; 2 &amp;&amp; drone.flight == |"/>')) == {"ON_GROUND", "IN_AIR"}
    assert set(completed(folder, '<ScriptCondition code="drone.|"/>')) == {"axes", "flight"}
    assert set(completed(folder, '<ScriptCondition code="running(|"/>')) == {"drone.hover", "drone.turn", "drone.watch"}
    assert {"running(", "drone.flight"} <= set(completed(folder, '<AlwaysSuccess _skipIf="|"/>'))
    assert completed(folder, '<Sleep msec="|"/>') == {}


def test_fields_of_data_are_offered_and_told(folder):
    model = ROBOT.replace("skillset drone {", "type Battery\nskillset drone {\n  data battery: Battery\n  data height: float64", 1)
    (folder / "skillsets" / "drone.rl").write_text(model)
    (folder / "skillsets" / "types.yaml").write_text("Battery: drone_msgs/Battery\n")
    package = folder / "ros2_ws/src/drone_msgs/msg"
    package.mkdir(parents=True)
    (package / "Battery.msg").write_text("float64 level\nCell first\nstring[] makers\n")
    (package / "Cell.msg").write_text("float64 volts\n")
    assert set(completed(folder, '<ScriptCondition code="drone.|"/>')) == {"axes", "flight", "battery", "height"}
    offered = completed(folder, '<ScriptCondition code="drone.battery.|"/>')
    assert offered == {"level": "float64", "first": "drone_msgs/Cell", "makers": "string[]"}
    assert completed(folder, '<ScriptCondition code="drone.battery.first.vo|"/>') == {"volts": "float64"}
    for nothing in ("drone.height.", "drone.battery.level.", "drone.battery.makers.", "drone.nothing."):
        assert completed(folder, f'<ScriptCondition code="{nothing}|"/>') == {}
    missions = Missions()
    file = missions.checked(
        str(folder / "missions" / "m.xml"), whole('<ScriptCondition code="drone.battery.first.volts &lt; drone.height"/>')
    )
    told = [missions.description(file, Place(3, file.line(3).index(word) + 1))[0] for word in ("battery", "height")]
    assert told == ["data drone.battery.first.volts: float64", "data drone.height: float64"]


def test_a_name_is_told_by_its_model(folder):
    missions = Missions()
    file = missions.checked(str(folder / "missions" / "m.xml"), whole('<drone.hover duration="1" _skipIf="drone.flight == IN_AIR"/>'))
    text, first, end = missions.description(file, Place(3, 8))
    assert text.splitlines() == ["skill drone.hover", "  input duration: float64 // s", "  success DONE", "  failure ABORTED"]
    assert file.line(3)[first - 1 : end - 1] == "drone.hover"
    column = file.line(3).index("flight")
    assert missions.description(file, Place(3, column + 1))[0] == "resource drone.flight { ON_GROUND IN_AIR }"
    assert missions.description(file, Place(3, file.line(3).index("duration") + 1)) is None


def test_models_that_change_are_read_again(folder):
    missions, path = Missions(), str(folder / "missions" / "m.xml")
    text = whole("<ForceSuccess><drone.land/></ForceSuccess>")
    assert [one.code for one in missions.checked(path, text).findings] == ["ALU601"]
    model = folder / "skillsets" / "drone.rl"
    model.write_text(ROBOT.replace("skill watch {", "skill land { success DOWN {} }\n  skill watch {"))
    assert missions.checked(path, text).findings == []


OWN = """
import pathlib

from alula.missions.part import MissionPart
from alula.trees.node import SyncAction, register

pathlib.Path(__file__).with_name("imported").touch()


@register("robot.Wait")
class Wait(SyncAction):
    pass


PART = MissionPart(nodes=(Wait,))
"""


def test_opening_a_mission_runs_no_python_of_its_robot(folder):
    (folder / "robot.yaml").write_text("name: drone\nskillsets: skillsets\npython: [own]\nparts: {missions: 'own_part_of_editor:PART'}\n")
    (folder / "own").mkdir()
    (folder / "own" / "own_part_of_editor.py").write_text(OWN)
    path, text = str(folder / "missions" / "m.xml"), whole("<ForceSuccess><robot.Wait/></ForceSuccess>")
    missions = Missions()
    file = missions.checked(path, text)
    missions.completions(file, Place(3, 6))
    (finding,) = file.findings
    assert (finding.code, finding.severity) == ("ALU601", Severity.NOTE)
    assert "--trust" in finding.hint
    assert not (folder / "own" / "imported").exists()
    assert Missions(trusted=True).checked(path, text).findings == []
    assert (folder / "own" / "imported").exists()


def test_an_editing_session(folder):
    editor = Editor()
    uri = (folder / "missions" / "m.xml").as_uri()
    document = {"uri": uri, "languageId": "xml", "version": 1, "text": whole('<ForceSuccess><drone.hovr duration="2"/></ForceSuccess>')}
    try:
        editor.ask("initialize", {"processId": None, "rootUri": None, "capabilities": {}})
        editor.send("initialized", {})
        editor.send("textDocument/didOpen", {"textDocument": document})
        (finding,) = editor.told()["diagnostics"]
        assert finding["code"] == "ALU601"
        assert finding["range"]["start"] == {"line": 2, "character": 18}
        mended = {"text": document["text"].replace("hovr", "hover")}
        changed = {"uri": uri, "version": 2}
        editor.send("textDocument/didChange", {"textDocument": changed, "contentChanges": [mended]})
        assert editor.told()["diagnostics"] == []
        where = {"textDocument": {"uri": uri}, "position": {"line": 2, "character": 22}}
        assert "skill drone.hover" in editor.ask("textDocument/hover", where)["contents"]["value"]
        assert "drone.turn" in {item["label"] for item in editor.ask("textDocument/completion", where)["items"]}
        for request in ("formatting", "documentSymbol"):
            assert not editor.ask(
                f"textDocument/{request}", {"textDocument": {"uri": uri}, "options": {"tabSize": 2, "insertSpaces": True}}
            )
        assert editor.ask("textDocument/definition", where) is None
        editor.ask("shutdown", None)
        editor.send("exit", None)
        assert editor.process.wait(HANGS_S) == 0
    finally:
        editor.process.kill()
        editor.process.wait(HANGS_S)
