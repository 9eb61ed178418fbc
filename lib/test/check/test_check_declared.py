"""Nodes that a file declares: those that no class makes, those that have the name of one of ours, and Nav2's."""

from __future__ import annotations

import pytest

from alula.api.checking import checked_files, prove_files
from alula.check.findings import findings_of
from alula.language.errors import Severity
from alula.language.models import ModelFile, check_texts
from alula.missions.mission_file import MissionFile, plan_of_file
from alula.missions.part import NO_PART, MissionPart
from alula.missions.plan import InputError
from alula.prove.mission.prover import prove_mission
from alula.trees.node import SyncAction
from alula.trees.ports import input_port
from alula.trees.status import SUCCESS
from finding_pages.mission_checks import ROBOT

FILE = """<root BTCPP_format="4" main_tree_to_execute="m">
  <BehaviorTree ID="m">{}</BehaviorTree>
  <TreeNodesModel>{}</TreeNodesModel>
</root>
"""
GRIP = '<Action ID="Grip"><input_port name="force"/><output_port name="held" type="double" default="{held}"/></Action>'
WAIT_FOR = '<Action ID="WaitFor"><input_port name="signal"/></Action>'
CHECKED = '<Sequence><Grip force="2"/><Grip/><ForceSuccess><drone.hover duration="2"/></ForceSuccess></Sequence>'


@pytest.fixture(scope="module")
def robot():
    (file,) = check_texts([ModelFile("robot.rl", ROBOT)])
    return file.skillsets


def found(body, models, robot, part=NO_PART):
    return findings_of("m.xml", FILE.format(body, models).encode(), robot, part=part)


class Grip(SyncAction):
    """Grips."""

    ports = (input_port("force", default="1"),)

    def update(self):
        """Grip."""
        return SUCCESS


def test_a_node_that_no_class_makes_is_one_warning_that_says_what_to_do(robot):
    (finding,) = found(CHECKED, GRIP, robot)
    assert (finding.code, finding.severity, finding.span.line) == ("ALU620", Severity.WARNING, 2)
    assert "'Grip' is declared in the file" in finding.message
    assert "a class for Grip in the robot's part `missions`" in finding.hint


def test_a_run_refuses_it_with_the_same_words(robot, tmp_path):
    path = tmp_path / "m.xml"
    path.write_text(FILE.format(CHECKED, GRIP))
    with pytest.raises(InputError, match=r"m\.xml:2:.*'Grip' is declared.*part `missions`"):
        plan_of_file(path, "m", robot, {}, NO_PART)


def test_a_class_of_the_robot_makes_it(robot, tmp_path):
    part = MissionPart((Grip,))
    model = GRIP.replace('<output_port name="held" type="double" default="{held}"/>', "")
    path = tmp_path / "m.xml"
    path.write_text(FILE.format(CHECKED, model))
    assert plan_of_file(path, "m", robot, {}, part).skillsets == ("drone",)
    assert found(CHECKED, model, robot, part) == []


def test_the_files_own_declaration_wins_over_a_node_of_ours(robot, tmp_path):
    (finding,) = found('<WaitFor signal="go"/>', WAIT_FOR, robot)
    assert finding.code == "ALU620"
    assert "'WaitFor' is declared otherwise than the node of that name here" in finding.message
    path = tmp_path / "m.xml"
    path.write_text(FILE.format('<WaitFor signal="go"/>', WAIT_FOR))
    with pytest.raises(InputError, match="taken for another"):
        plan_of_file(path, "m", robot, {}, NO_PART)


def test_a_declaration_of_a_node_of_ours_as_it_is_changes_nothing(robot):
    assert found('<WaitFor if="1"/>', '<Action ID="WaitFor"><input_port name="if"/></Action>', robot) == []


def test_what_is_checked_with_nav2s_nodes_can_be_run(robot, tmp_path):
    body = '<RecoveryNode number_of_retries="2"><RateController hz="1"><AlwaysSuccess/></RateController><AlwaysSuccess/></RecoveryNode>'
    path = tmp_path / "m.xml"
    path.write_text(FILE.format(body, '<Control ID="RecoveryNode"><input_port name="number_of_retries"/></Control>'))
    assert findings_of(str(path), path.read_bytes(), robot) == []
    assert plan_of_file(path, "m", robot, {}, NO_PART).skillsets == ("drone",)


def test_nav2_reads_goals_unchecked(robot):
    goal = '<GoalUpdater input_goal="{goal}" output_goal="{g}"><GoalUpdater input_goal="{g}"><AlwaysSuccess/></GoalUpdater></GoalUpdater>'
    (read, unmade) = found(goal, "", robot)
    assert (read.code, read.severity, unmade.code) == ("ALU607", Severity.WARNING, "ALU620")
    assert read.message == "`goal` is read, nothing before writes it, and 'GoalUpdater' goes on with an empty one"
    assert found("<GoalUpdatedController><AlwaysSuccess/></GoalUpdatedController>", "", robot) == []


def test_an_output_is_written_by_its_default(robot):
    body = '<Sequence><Grip force="2"/>{}<ScriptCondition code="held == 1"/></Sequence>'
    assert [one.code for one in found(body.format(""), GRIP, robot)] == ["ALU620"]
    without = GRIP.replace(' default="{held}"', "")
    assert sorted(one.code for one in found(body.format(""), without, robot)) == ["ALU607", "ALU620"]


def test_proofs_take_it_for_a_node_that_may_do_anything(robot, tmp_path):
    """It may fail, so the skill after it may not be reached, and may succeed, so it may be."""
    path = tmp_path / "m.xml"
    body = '<Fallback><Sequence><Grip force="1"/><ScriptCondition code="held == 1"/></Sequence><drone.hover duration="2"/></Fallback>'
    path.write_text(FILE.format(body, GRIP))
    proved = prove_mission(MissionFile.read(path, robot, NO_PART), timeout_s=60)
    codes = [one.code for one in (*proved.findings, *proved.accepted)]
    assert "ALU711" not in codes
    assert not [one for one in proved.findings if "never ticked" in one.message]


OTHERS = """<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">
  <Sequence><Script code="x := 1"/><Find goal="{goal}"/><ScriptCondition code="x == 1"/><Goto goal="{goal}"/></Sequence>
  </BehaviorTree></root>"""
NODES = """<root BTCPP_format="4"><TreeNodesModel>
  <Action ID="Find"><output_port name="goal"/></Action><Action ID="Goto"><input_port name="goal"/></Action>
  </TreeNodesModel></root>"""


def proved_of_others(folder, text, *palettes, place=None):
    """Return codes and severities of what is found about a tree of another program."""
    path = folder / "tree.xml"
    path.write_text(text)
    files = checked_files([str(place or path)], palettes=list(map(str, palettes)))
    prove_files(files, 20.0)
    return [(one.code, one.severity.value) for file in files for one in file.findings]


def test_the_runs_of_a_tree_of_others_are_looked_at_where_it_is_named_and_lacks_nothing(tmp_path):
    palette = tmp_path / "palettes/nodes.xml"
    palette.parent.mkdir()
    palette.write_text(NODES)
    (tmp_path / "trees").mkdir()
    found = proved_of_others(tmp_path / "trees", OTHERS, palette)
    assert sorted(found) == [("ALU706", "warning"), ("ALU715", "note"), ("ALU715", "note")]  # always true; Find, Goto
    assert proved_of_others(tmp_path / "trees", OTHERS, palette, place=tmp_path / "trees") == []
    assert "ALU711" not in {code for code, _ in proved_of_others(tmp_path / "trees", OTHERS)}
    unwritten = OTHERS.replace('<Goto goal="{goal}"/>', '<ScriptCondition code="unwritten == 1"/>')
    assert not {"ALU706", "ALU711"} & {code for code, _ in proved_of_others(tmp_path / "trees", unwritten, palette)}


def test_the_time_of_a_search_bounds_a_tick_of_many_leaves_that_may_answer_anything(tmp_path):
    """Twenty leaves that may be skipped or succeed are a million ways of one tick."""
    leaves = "".join(f'<Find goal="{{g{number}}}"/>' for number in range(20))
    models = '<TreeNodesModel><Action ID="Find"><output_port name="goal"/></Action></TreeNodesModel>'
    body = f'<BehaviorTree ID="Main"><Sequence>{leaves}</Sequence></BehaviorTree>'
    text = f'<root BTCPP_format="4" main_tree_to_execute="Main">{body}{models}</root>'
    path = tmp_path / "tree.xml"
    path.write_text(text)
    proved = prove_mission(MissionFile.read(path, (), NO_PART), timeout_s=1.0)
    assert "ALU710" in {one.code for one in proved.findings}
