"""Missions whose subtrees stand in other files: checked, proved, played, flown over mocks and reckoned with the same library."""

import json
from pathlib import Path

import pytest

from alula import Mission, open_run
from alula.api.checking import checked_files, prove_files
from alula.cli.check import main as check
from alula.cli.run import main as run
from alula.common.robots import load_robot_folder, meaning
from alula.common.scenarios import ScenarioError, load_scenario
from alula.language.load import load_skillset
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART
from alula.odds.robot import graph_of
from alula.prove.mission.system import System

DOOR = """
skillset door {
  resource leaf { initial SHUT  SHUT -> OPEN  OPEN -> SHUT  extern SHUT -> JAMMED  extern OPEN -> JAMMED }
  skill open {
    effect { up: leaf -> OPEN }
    precondition { is_shut: resource = (leaf == SHUT) }
    invariant { not_jammed: resource = (leaf != JAMMED) }
    result { OPENED: apply = up }
  }
}
"""
OUTING = '<root BTCPP_format="4"{}><BehaviorTree ID="outing"><Sequence><SubTree ID="knock"/></Sequence></BehaviorTree></root>'
KNOCK = '<root BTCPP_format="4"><BehaviorTree ID="knock">{}</BehaviorTree></root>'
OPENS = '<door.open name="open it"/>'
SCENARIO = "about: goes out\nmission: missions/outing.xml\nskillsets: [door]\n"


@pytest.fixture
def robot(tmp_path):
    """A robot with a mission that uses a tree of another folder; its scenario says where that is."""
    for name, text in {
        "robot.yaml": "name: porter\n",
        "skillsets/door.skill": DOOR,
        "skillsets/mock.yaml": "skills: {door.open: {delay: 2}}\nfaults: {jam: {set: {door.leaf: JAMMED}}}\n",
        "missions/outing.xml": OUTING.format(""),
        "trees/knock.xml": KNOCK.format(OPENS),
        "scenarios/outing.yaml": f"{SCENARIO}library: [../trees]\n",
    }.items():
        path = tmp_path / "porter" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    folder = tmp_path / "porter"
    with meaning(load_robot_folder(folder)):
        yield folder


def proved(*places: Path, main: str = "", enums: dict[str, float] | None = None) -> dict[str, list[str]]:
    files = checked_files([str(place) for place in places], main=main, enums=enums or {})
    prove_files(files, 30.0)
    return {Path(file.path).name: [one.code for one in file.findings] for file in files}


def test_a_scenario_says_where_the_trees_of_its_mission_are(robot, tmp_path):
    assert load_scenario("outing").library == (robot / "scenarios/../trees",)
    mission = Mission.load("outing", robot).run(seed=1, out=tmp_path / "run")
    assert [(one.skill, one.result) for one in mission.ended] == [("open", "OPENED")]
    assert open_run(tmp_path / "run").outcome.value == "accomplished"
    assert Mission.load("outing", robot).run("jam@1").outcome.value == "given_up"


def test_the_command_flies_it_over_mocks(robot, tmp_path, capsys):
    assert run(["outing", "--mock", "--out", str(tmp_path / "run")]) == 0
    assert json.loads((tmp_path / "run/summary.json").read_text())["outcome"] == "accomplished"
    (robot / "scenarios/outing.yaml").write_text(SCENARIO)
    assert run(["outing", "--mock", "--out", str(tmp_path / "other")]) == 2
    assert "there is no tree 'knock'" in capsys.readouterr().err


def test_its_proof_knows_the_scenarios_library(robot):
    """Nothing answers a failure of the skill in the tree of the other file."""
    assert proved(robot / "missions/outing.xml") == {"outing.xml": ["ALU701", "ALU705"]}


def test_a_folder_is_proved_as_it_was_checked(robot):
    """What is a part of another mission is looked at there, and not for itself."""
    (robot / "scenarios/outing.yaml").write_text(SCENARIO)
    (robot / "trees/knock.xml").rename(robot / "missions/knock.xml")
    assert proved(robot / "missions/outing.xml") == {"outing.xml": ["ALU617"]}
    found = proved(robot / "missions")
    assert "ALU711" not in found["outing.xml"]
    assert (found["outing.xml"], found["knock.xml"]) == (["ALU701", "ALU705"], [])


def test_a_counterexample_of_a_folder_is_played_with_its_library(robot, tmp_path, capsys):
    (robot / "scenarios/outing.yaml").write_text(SCENARIO)
    assert check([str(robot / "missions/outing.xml"), str(robot / "trees"), "--play", "1", "--out", str(tmp_path / "played")]) == 0
    assert "the mission comes to the same" in capsys.readouterr().out
    (robot / "trees/knock.xml").rename(robot / "missions/knock.xml")
    assert check([str(robot / "missions"), "--play", "1", "--out", str(tmp_path / "again")]) == 0


def test_the_main_tree_and_the_enums_that_were_given_are_proved(robot):
    script = '<ScriptCondition code="2 == LEADER"/>'
    (robot / "trees/knock.xml").write_text(KNOCK.format(f"<Fallback>{OPENS}{script}</Fallback>"))
    wins, loses = (proved(robot / "missions/outing.xml", robot / "trees", enums={"LEADER": one})["outing.xml"] for one in (2.0, 1.0))
    assert "ALU711" not in (*wins, *loses)
    assert ("ALU705" in wins, "ALU705" in loses) == (False, True)
    two = OUTING.format("").replace("</root>", '<BehaviorTree ID="rest"><AlwaysSuccess/></BehaviorTree></root>')
    (robot / "missions/outing.xml").write_text(two)
    assert "ALU711" not in proved(robot / "missions/outing.xml", main="outing", enums={"LEADER": 1.0})["outing.xml"]


def test_the_odds_know_the_scenarios_library(robot):
    graph, _ = graph_of(robot / "missions/outing.xml")
    assert graph.steps


def test_a_mission_of_no_robot_is_given_its_library(robot):
    file, models = robot / "missions/outing.xml", [load_skillset(robot / "skillsets/door.skill")]
    mission = Mission.from_file(file, models, library=[robot / "trees"])
    assert mission.run(seed=1).outcome.value == "accomplished"


def test_a_library_that_is_not_there_is_told_with_its_place(robot):
    (robot / "scenarios/outing.yaml").write_text(f"{SCENARIO}library: [../trees, ../treees]\n")
    with pytest.raises(ScenarioError, match=r"outing.yaml:4: there is no folder .*/\.\./treees; the path counts from this file on"):
        load_scenario("outing")


def test_a_library_of_one_mission_is_none_of_others(robot):
    (robot / "missions/outing.xml").write_text(OUTING.format(' library="../trees"'))
    (robot / "missions/other.xml").write_text(OUTING.format("").replace("outing", "other"))
    found = proved(robot / "missions")
    assert (found["outing.xml"], found["other.xml"]) == (["ALU701", "ALU705"], ["ALU617"])


def test_the_search_reads_a_file_without_anything_else(robot):
    (robot / "missions/outing.xml").write_text(OUTING.format(' library="../trees"'))
    system = System.of(MissionFile.read(robot / "missions/outing.xml", [load_skillset(robot / "skillsets/door.skill")], NO_PART))
    assert [leaf.name for leaf in system.leaves] == ["open it"]
