"""A robot that is made of a folder of trees: what becomes of their nodes, what is told, and what works in it at once."""

from __future__ import annotations

import json
import re

import pytest
import yaml
from adopt_folders import DOOR, MAIN, folder_of, made, mains_of, tree

from alula import Mission, Outcome, Severity, check_files
from alula.adopt.robot import robot_from_trees
from alula.cli import check, generate, new, odds, palette, run
from alula.generate.scaffold.skeleton import write
from alula.language.load import load_robot
from alula.missions.part import NO_PART
from alula.missions.registry import registry_of
from alula.model.model import ResultKind
from alula.trees.answers import Answers, Step, StepClock, scripted_tree, ticks
from alula.trees.reading import read_files
from alula.trees.standard import standard_registry

SKILLS = {
    "grasp": ({"object": "string", "force": "int32", "if_port": "string"}, {"pose": "string"}),
    "move_to": ({"goal": "string", "speed": "float64"}, {"at": "string"}),
    "open_door": ({}, {}),
    "track": ({"target": "string"}, {"target_out": "string"}),
}


def skillset_of(robot):
    return load_robot(robot / "skillsets").skillsets[0]


def shape_of(skill):
    return tuple({one.name: one.type for one in parameters} for parameters in (skill.inputs, skill.outputs))


def elements(path, tag):
    return [one for tree in read_files(path).trees.values() for one in tree.iterate() if one.tag == tag]


def test_actions_are_skills_and_their_ports_typed_inputs_and_outputs(tmp_path):
    skillset = skillset_of(made(tmp_path, main=MAIN, door=DOOR))
    assert {one.name: shape_of(one) for one in skillset.skills} == SKILLS
    for skill in skillset.skills:
        kinds = {one.name: skill.kind_of(one.name) for one in skill.results}
        assert kinds == {"SUCCESS": ResultKind.SUCCESS, "FAILURE": ResultKind.FAILURE}


def test_conditions_are_resources_which_only_the_functional_layer_changes(tmp_path):
    resources = skillset_of(made(tmp_path, main=MAIN, door=DOOR)).resources
    assert [one.name for one in resources] == ["is_at_hall", "is_at_kitchen", "is_door_open"]
    assert {(transition.source, transition.target, transition.extern) for one in resources for transition in one.transitions} == {
        ("FAILS", "HOLDS", True),
        ("HOLDS", "FAILS", True),
    }


def test_what_works_in_it_at_once(tmp_path, about, capsys):
    robot = about(made(tmp_path, main=MAIN, door=DOOR))
    assert check.main([]) == 0
    assert check.main(["missions/deliver.xml"]) == 0
    out = capsys.readouterr().out
    assert "counterexample 1: `--play 1`" in out
    assert check.main(["missions/deliver.xml", "--play", "1", "--out", str(tmp_path / "played")]) in {0, 1}
    assert (tmp_path / "played/report.html").is_file()
    assert run.main(["deliver", "--mock", "--out", str(tmp_path / "run")]) == 0
    summary = json.loads((tmp_path / "run/summary.json").read_text())
    assert [one["skill"] for one in summary["skills"]] == ["open_door", "grasp", "move_to", "track"]
    assert (tmp_path / "run/report.html").is_file()
    assert run.main(["deliver", "--mock", "--fail", "move_to@2.5", "--out", str(tmp_path / "failed")]) == 1
    recovery = json.loads((tmp_path / "failed/summary.json").read_text())["recovery"]
    assert recovery["detected_s"] is not None
    assert odds.main(["missions/deliver.xml", "--json"]) == 0
    assert palette.main(["skillsets"]) == 0
    assert 'ID="rover.move_to"' in capsys.readouterr().out
    assert generate.main(["skillsets", "--out", str(tmp_path / "generated")]) == 0
    assert (tmp_path / "generated/rover_interfaces/action/MoveTo.action").is_file()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")], robot


def test_the_mission_ticks_as_the_tree_does(tmp_path):
    """The same answers of leaves and chances give the same ticks: names of nodes are kept, so are places and conditions."""
    robot = made(tmp_path, main=MAIN, door=DOOR)
    before = mains_of(tmp_path / "trees")[0]
    after = read_files(robot / "missions/deliver.xml")
    entries = yaml.safe_load((robot / "worlds/deliver.yaml").read_text())
    known = registry_of(after, [skillset_of(robot)], NO_PART)

    def told(files, types, decorator, seed):
        answers = Answers({"*": [Step(None)]}, entries=entries, stand_ins={decorator: "pass-through"}, seed=seed)
        clock = StepClock()
        return [(tick.root, tick.calls) for tick in ticks(scripted_tree(files, types, answers, clock), answers, 60, clock)]

    roots = set()
    for seed in range(20):
        ticked = told(before, standard_registry(), "Careful", seed)
        assert told(after, known, "rover.Careful", seed) == ticked
        roots |= {root for root, _ in ticked}
    assert roots == {"SUCCESS", "FAILURE", "RUNNING"}


def test_comments_and_names_are_kept(tmp_path):
    mission = (made(tmp_path, main=MAIN, door=DOOR) / "missions/deliver.xml").read_text()
    assert "<!-- Brings a cup. -->" in mission
    assert "<!-- Whoever is in the hall. -->" in mission
    assert '<rover.move_to name="MoveTo" goal="{pose}" at="{at}" speed="0.5"/>' in mission
    assert '<Condition ID="rover.is_at_hall" name="in the hall" state="HOLDS"/>' in mission


def test_a_condition_without_a_name_is_called_with_its_arguments(tmp_path):
    mission = (made(tmp_path, main=tree("<Go/>", '<IsAt room="hall"/>')) / "missions/main.xml").read_text()
    assert '<rover.is_at name="IsAt room=hall" state="HOLDS"/>' in mission


def test_what_a_person_has_to_decide_is_told(tmp_path, capsys):
    robot = made(tmp_path, main=MAIN, door=DOOR, other=tree("<OpenDoor/>", '<SubTree ID="Gone" a="1"/>', name="Other"))
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("to decide: ")]
    readme = (robot / "README.md").read_text()
    for words in (
        "`Careful`, `Gone`, `Grasp` and 2 more: not declared",
        "`Careful`: nodes with children of a program's own",
        "`Gone`: trees that are in no file",
        "`worlds/deliver.yaml`: stands for what a program writes",
    ):
        assert len([line for line in told if words in line]) == 1, words
        assert f"- {words}" in readme
    assert "`if` is `if_port`; `Pose` is `pose`" in readme
    assert str(tmp_path) not in "".join(path.read_text() for path in robot.rglob("*") if path.is_file())


def test_a_fault_of_each_skill_and_resource_has_the_mission_do_otherwise(tmp_path):
    robot = made(tmp_path, main=MAIN, door=DOOR)
    assert Mission.load("deliver", robot).run().outcome is Outcome.ACCOMPLISHED
    for fault in ("open_door@0.5", "grasp@1.5", "move_to@2.5", "track@3.5", "is_at_hall@1", "is_at_kitchen@1"):
        assert Mission.load("deliver", robot).run(fault).outcome is Outcome.GIVEN_UP, fault
    opened = Mission.load("deliver", robot).run("is_door_open")
    assert [one.skill for one in opened.executions] == ["grasp", "move_to", "track"]


def test_a_condition_that_writes_is_a_skill(tmp_path):
    skillset = skillset_of(made(tmp_path, main=tree('<Go/><Condition ID="Seen" result="{where}"/>')))
    assert {one.name: shape_of(one) for one in skillset.skills} == {"go": ({}, {}), "seen": ({}, {"result_port": "string"})}
    assert skillset.resources == ()


def test_ports_without_a_type_have_that_of_their_entry(tmp_path):
    text = tree(
        '<Count n="{n}"/>', '<Repeat num_cycles="{n}"><Say words="{w}"/></Repeat>', "<Script code=\"w := 'hi'\"/>", '<Use x="{n}"/>'
    )
    skills = {one.name: shape_of(one) for one in skillset_of(made(tmp_path, main=text)).skills}
    assert skills == {"count": ({}, {"n": "int32"}), "say": ({"words": "string"}, {}), "use_node": ({"x": "int32"}, {})}


def test_a_port_with_a_text_that_its_type_is_not_read_from_is_a_text(tmp_path):
    model = '<TreeNodesModel><Action ID="Blink"><input_port name="mode" type="int"/></Action></TreeNodesModel>'
    text = tree('<Blink mode="READY"/>', '<Wait for="5"/>', '<Wait for="{pause}"/>', rest=model)
    skills = {one.name: shape_of(one)[0] for one in skillset_of(made(tmp_path, main=text)).skills}
    assert skills == {"blink": {"mode": "string"}, "wait": {"for_port": "float64"}}


def test_nodes_that_nav2_declares_are_known_unless_their_ports_are_others(tmp_path):
    skillset = skillset_of(made(tmp_path, main=tree('<GoalReached goal="{g}"/>', '<Wait wait_duration="5"/>', '<Spin turns="2"/>')))
    assert [one.name for one in skillset.resources] == ["goal_reached"]
    assert {one.name: shape_of(one)[0] for one in skillset.skills}["spin"] == {"turns": "int32"}


def test_an_input_that_a_use_leaves_out_is_given(tmp_path, about):
    robot = about(made(tmp_path, main=tree('<Go a="1" on="true" b="x"/>', "<Go/>")))
    second = elements(robot / "missions/main.xml", "rover.go")[1]
    assert {name: second.get(name) for name in ("a", "on", "b")} == {"a": "0", "on": "false", "b": ""}
    assert Mission.load("main", robot).run().outcome is Outcome.ACCOMPLISHED


def test_entries_that_a_program_writes_stand_in_a_world(tmp_path):
    text = tree('<Go goal="{home}"/>', '<Script code="count := start + 1; mode := FAST"/>', '<Go goal="{count}"/>', '<Say on="{on}"/>')
    model = '<TreeNodesModel><SubTree ID="Main"><input_port name="route" default="1;2"/></SubTree></TreeNodesModel>'
    robot = made(tmp_path, main=text.replace("</root>", f"{model}</root>"))
    assert yaml.safe_load((robot / "worlds/main.yaml").read_text()) == {"FAST": 1, "home": "", "on": "", "route": "1;2", "start": 0.0}
    run_ = Mission.load("main", robot).run()
    assert run_.outcome is Outcome.ACCOMPLISHED


def test_an_entry_that_a_node_does_without_and_nothing_writes_stands_in_the_world(tmp_path):
    text = tree('<GoalUpdater input_goal="{goal}" output_goal="{newest}"><Go goal="{newest}"/></GoalUpdater>')
    robot = made(tmp_path, main=text)
    assert yaml.safe_load((robot / "worlds/main.yaml").read_text()) == {"goal": ""}
    assert Mission.load("main", robot).run().outcome is Outcome.ACCOMPLISHED


def test_trees_that_several_missions_use_stand_in_one_file(tmp_path, about, capsys):
    use = '<SubTree ID="Enter"/>'
    robot = about(made(tmp_path, a=tree("<Go/>", use, name="A"), b=tree("<Stop/>", use, name="B"), door=DOOR))
    assert sorted(path.name for path in (robot / "missions").iterdir()) == ["a.xml", "b.xml", "shared.xml"]
    for name in ("a", "b"):
        assert "open_door" not in (robot / f"missions/{name}.xml").read_text()
        assert check.main([f"missions/{name}.xml"]) == 0
        assert Mission.load(name, robot).run().outcome is Outcome.ACCOMPLISHED


def test_missions_of_one_id_have_the_names_of_their_files(tmp_path):
    robot = made(
        tmp_path, first=tree("<Go/>"), second=tree("<Stop/>"), third='<root BTCPP_format="4"><BehaviorTree><Go/></BehaviorTree></root>'
    )
    assert sorted(path.stem for path in (robot / "scenarios").iterdir()) == ["first", "second", "third"]


def test_one_main_tree_is_chosen(tmp_path):
    robot = made(tmp_path, "--main", "B", a=tree("<Go/>", name="A"), b=tree("<Stop/>", name="B"))
    assert [path.stem for path in (robot / "scenarios").iterdir()] == ["b"]
    assert [one.name for one in skillset_of(robot).skills] == ["stop"]


def test_a_tree_of_format_3_is_converted(tmp_path, about):
    inner = '<BehaviorTree ID="Go"><MoveTo goal="{to}"/></BehaviorTree>'
    text = tree('<SequenceStar><Find at="{x}"/><SubTree ID="Go" to="x"/></SequenceStar>', rest=inner, root=' main_tree_to_execute="Main"')
    robot = about(made(tmp_path, main=text))
    mission = (robot / "missions/main.xml").read_text()
    assert '<SubTree ID="Go" to="{x}"/>' in mission
    assert "<SequenceWithMemory>" in mission
    assert Mission.load("main", robot).run().outcome is Outcome.ACCOMPLISHED


def test_a_subtree_gets_what_its_model_has_by_default(tmp_path):
    model = '<SubTree ID="Go"><input_port name="to" default="home"/><input_port name="by" default="{way}"/></SubTree>'
    inner = f'<BehaviorTree ID="Go"><MoveTo goal="{{to}}" by="{{by}}"/></BehaviorTree><TreeNodesModel>{model}</TreeNodesModel>'
    root = ' BTCPP_format="4" main_tree_to_execute="Main"'
    robot = made(tmp_path, main=tree('<SubTree ID="Go"/>', '<SubTree ID="Go" to="yard"/>', rest=inner, root=root))
    goals = [(one.inputs.goal, one.inputs.by) for one in Mission.load("main", robot).run().executions]
    assert goals == [("home", ""), ("yard", "")]
    assert yaml.safe_load((robot / "worlds/main.yaml").read_text()) == {"way": ""}


def test_trees_that_no_main_tree_uses_are_told(tmp_path, capsys):
    rest = '<BehaviorTree ID="Spare"><Sit/></BehaviorTree>'
    robot = made(tmp_path, main=tree("<Go/>", rest=rest, root=' BTCPP_format="4" main_tree_to_execute="Main"'))
    assert "to decide: `Spare`: trees that no main tree uses" in capsys.readouterr().out
    assert [one.name for one in skillset_of(robot).skills] == ["go"]


def test_trees_of_names_that_mean_something_in_missions_are_renamed(tmp_path):
    robot = made(tmp_path, main=tree("<Go/>", '<SubTree ID="ready"/>'), ready=tree("<Look/>", name="ready"))
    assert set(read_files(robot / "missions/main.xml").trees) == {"Main", "ready_tree"}
    assert [one.skill for one in Mission.load("main", robot).run().executions] == ["go", "look"]


def test_a_port_called_as_its_entry_and_an_output_without_one(tmp_path):
    robot = made(tmp_path, main=tree('<Find Pose="{=}"/>', '<MoveTo goal="{Pose}" result="done"/>'))
    mission = (robot / "missions/main.xml").read_text()
    assert '<rover.find name="Find" pose="{Pose}"/>' in mission


@pytest.mark.parametrize(
    ("kind", "outcome"), [("Chooser", Outcome.GIVEN_UP), ("TrySeveral", Outcome.ACCOMPLISHED), ("Careful", Outcome.GIVEN_UP)]
)
def test_a_class_stands_in_for_a_node_with_children(tmp_path, kind, outcome):
    children = "<Go/>" if kind == "Careful" else "<Go/><Stop/>"
    robot = made(tmp_path, main=tree(f'<{kind} result="{{r}}">{children}</{kind}>', '<Say words="{r}"/>'))
    assert Mission.load("main", robot).run().outcome is Outcome.ACCOMPLISHED
    assert Mission.load("main", robot).run("go@0.5").outcome is outcome
    findings = check_files(robot / "missions/main.xml", robot=robot)
    assert [str(one) for one in findings if one.severity is Severity.ERROR] == []


@pytest.mark.parametrize(
    ("files", "options", "words"),
    [
        ({"main": tree("<AlwaysSuccess/>")}, [], "no action of their own"),
        ({}, [], "there is no file of trees in this folder"),
        ({"main": tree("<Go/>")}, ["--main", "Man"], "did you mean Main?"),
        ({"main": "<root><BehaviorTree"}, [], "is no XML"),
    ],
)
def test_what_no_robot_can_be_made_of_is_one_error_and_nothing_is_written(tmp_path, capsys, files, options, words):
    folder = folder_of(tmp_path, **files)
    assert new.main(["robot", str(tmp_path / "rover"), "--from-trees", str(folder), *options]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.startswith("alula new: ")
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == [folder]


@pytest.mark.parametrize("words", [["--main", "A"], ["--package", "a=."]])
def test_options_about_trees_go_with_trees(tmp_path, capsys, words):
    assert new.main(["robot", str(tmp_path / "rover"), *words]) == 2
    assert capsys.readouterr().err == f"alula new: {words[0]}: goes with --from-trees FOLDER\n"
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_there_is_left_alone(tmp_path, capsys):
    robot = tmp_path / "rover"
    robot.mkdir()
    (robot / "mine").write_text("mine")
    assert new.main(["robot", str(robot), "--from-trees", str(folder_of(tmp_path, main=MAIN))]) == 2
    assert re.search(r"is there already; choose another folder", capsys.readouterr().err)
    assert [path.name for path in robot.iterdir()] == ["mine"]


def test_a_folder_has_all_files_or_none(tmp_path):
    with pytest.raises(OSError, match="File exists"):
        write(tmp_path / "rover", {"a": "a file", "a/b": "can't lie in a file"})
    assert not list(tmp_path.iterdir())


def test_a_broken_file_keeps_no_other_from_being_used(tmp_path, capsys):
    robot = made(tmp_path, broken="<root><BehaviorTree", main=tree("<Go/>"))
    assert "left out: " in capsys.readouterr().err
    assert [path.stem for path in (robot / "scenarios").iterdir()] == ["main"]


def test_the_same_trees_give_the_same_robot(tmp_path):
    folder = folder_of(tmp_path, main=MAIN, door=DOOR)
    wrong = []
    first, second = (robot_from_trees("rover", mains_of(folder), folder, wrong.append) for _ in range(2))
    assert first == second
    assert not wrong


def test_a_tree_that_contains_itself_is_left_out(tmp_path, capsys):
    inner = '<BehaviorTree ID="Loop"><SubTree ID="Loop"/></BehaviorTree>'
    endless = tree("<Go/>", '<SubTree ID="Loop"/>', name="Endless", rest=inner, root=' BTCPP_format="4" main_tree_to_execute="Endless"')
    robot = made(tmp_path, endless=endless, main=tree("<Stop/>"))
    error = capsys.readouterr().err
    assert error.startswith("alula new: left out: ")
    assert "a tree contains itself: 'Loop' in 'Loop'" in error
    assert [path.stem for path in (robot / "scenarios").iterdir()] == ["main"]


def test_a_robot_of_one_file(tmp_path):
    folder = folder_of(tmp_path, main=tree("<Go/>"), other=tree("<Stop/>", name="Other"))
    assert new.main(["robot", str(tmp_path / "rover"), "--from-trees", str(folder / "main.xml")]) == 0
    assert [one.name for one in skillset_of(tmp_path / "rover").skills] == ["go"]
