"""A mission without any robot: drawn, and ticked by scripted answers."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import pytest

pytest.importorskip("py_trees")

from alula.cli import tree

FILE = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Fallback>
      <Sequence name="fly">
        <navigation.goto name="there" target="{waypoint}" speed="1.0" _skipIf="near == 1"/>
        <SubTree ID="Look" name="looking" at="{waypoint}"/>
      </Sequence>
      <give_up/>
    </Fallback>
  </BehaviorTree>
  <BehaviorTree ID="Look"><Action ID="camera.look"/></BehaviorTree>
</root>"""
PLAIN = """<root BTCPP_format="4"><BehaviorTree ID="Main"><ReactiveSequence><a/><b/></ReactiveSequence></BehaviorTree></root>"""


@pytest.fixture
def alula(tmp_path, capsys):
    """Return a function that draws or ticks the text of a tree: (exit code, standard output, standard error)."""

    def run(text, *words, answers=None):
        file = tmp_path / "mission.xml"
        file.write_text(text)
        if answers is not None:
            (tmp_path / "answers.json").write_text(answers if isinstance(answers, str) else json.dumps(answers))
            words = (*words, "--answers", str(tmp_path / "answers.json"))
        code = tree.main([str(file), *words])
        out = capsys.readouterr()
        return code, out.out, out.err

    return run


def lines(done) -> list[dict]:
    code, out, err = done
    assert (code, err) == (0, "")
    return [json.loads(line) for line in out.splitlines()]


# --- answers -------------------------------------------------------------------------------------------------------------


def test_each_tick_is_a_line_with_what_the_leaves_were_asked(alula):
    answers = {"a": ["SUCCESS", "SUCCESS", "FAILURE", "SUCCESS"], "b": ["RUNNING"]}
    assert lines(alula(PLAIN, "--ticks", "4", "--json", answers=answers)) == [
        {"tick": 1, "root": "RUNNING", "calls": [["start", "a"], ["start", "b"]]},
        {"tick": 2, "root": "RUNNING", "calls": [["start", "a"], ["tick", "b"]]},
        {"tick": 3, "root": "FAILURE", "calls": [["start", "a"], ["halt", "b"]]},
        {"tick": 4, "root": "RUNNING", "calls": [["start", "a"], ["start", "b"]]},
    ]


def test_the_last_answer_repeats_and_an_ended_root_is_ticked_anew(alula):
    found = lines(alula(PLAIN, "--ticks", "3", "--json", answers={"a": ["SKIPPED"], "b": ["RUNNING", "SUCCESS"]}))
    assert [one["root"] for one in found] == ["RUNNING", "SUCCESS", "SUCCESS"]
    assert found[2]["calls"] == [["start", "a"], ["start", "b"]]


def test_leaves_of_one_name_take_their_answers_in_turn(alula):
    text = PLAIN.replace("<b/>", '<b name="a"/>').replace("ReactiveSequence", "Sequence")
    assert lines(alula(text, "--ticks", "1", "--json", answers={"a": ["SUCCESS", "FAILURE"]}))[0]["root"] == "FAILURE"


def test_a_leaf_of_the_engine_is_scripted_where_the_answers_name_it(alula):
    text = PLAIN.replace("<a/>", '<ScriptCondition name="in the air" code="navigation.flight_status == 1"/>')
    assert lines(alula(text, "--ticks", "1", "--json", answers={"in the air": ["FAILURE"]}))[0]["root"] == "FAILURE"
    code, _, err = alula(text, "--ticks", "1", "--json", answers={"b": ["FAILURE"]})
    assert code == 2
    assert "mission.xml:1:" in err
    assert "navigation.flight_status" in err


def test_a_tick_takes_a_tenth_of_a_second(alula):
    text = PLAIN.replace("<a/>", '<Sleep msec="250"/>').replace("ReactiveSequence", "Sequence")
    found = lines(alula(text, "--ticks", "4", "--json", answers={"b": ["SUCCESS"]}))
    assert [one["root"] for one in found] == ["RUNNING", "RUNNING", "RUNNING", "SUCCESS"]


def test_ticks_are_told_in_words_without_json(alula):
    code, out, _ = alula(PLAIN, "--ticks", "2", answers={"a": ["SUCCESS"], "b": ["RUNNING"]})
    assert (code, out) == (0, "tick 1: RUNNING, start a, start b\ntick 2: RUNNING, start a, tick b\n")


def test_a_palette_tells_of_types_of_node(alula, tmp_path):
    (tmp_path / "nodes.xml").write_text(
        '<root><TreeNodesModel><Condition ID="a"><input_port name="x" default="1"/></Condition><Control ID="Mine"/></TreeNodesModel></root>'
    )
    palette = ("--palette", str(tmp_path / "nodes.xml"))
    assert alula(PLAIN.replace("<a/>", '<a x="2"/>'), *palette)[0] == 0
    code, _, err = alula(PLAIN.replace("<a/>", '<a y="2"/>'), *palette)
    assert code == 2
    assert "'a' has no port 'y'" in err
    code, _, err = alula(PLAIN.replace("ReactiveSequence", "Mine"), *palette, answers={"a": ["SUCCESS"]})
    assert code == 2
    assert "nothing here ticks a 'Mine'" in err


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ("[1", "is no JSON"),
        ("[" * 100_000, "is no JSON"),
        ("[]", 'is no object; write {"leaf name": ["RUNNING", "SUCCESS"], ...}'),
        ({"a": "SUCCESS"}, "'a': is no list of answers"),
        ({"a": []}, "'a': is no list of answers"),
        ({"a": ["DONE"]}, "'a': \"DONE\" is no answer; there are RUNNING, SUCCESS, FAILURE, SKIPPED"),
        ({"a": [["SUCCESS"]]}, "is no answer"),
        ({"a": ["IDLE"]}, '"IDLE" is no answer'),
        ({"a": ["SUCCESS"], "bee": ["SUCCESS"]}, "name 'bee', which is no leaf of the tree; its leaves are a, b"),
        ({"b": ["SUCCESS"]}, 'the answers say nothing of \'a\'; add "a": ["SUCCESS"]'),
    ],
)
def test_wrong_answers_are_told_in_a_line(alula, answers, words):
    code, out, err = alula(PLAIN, "--json", answers=answers)
    assert (code, out) == (2, "")
    assert err.startswith("alula tree: ")
    assert err.count("\n") == 1
    assert words in err


def test_files_that_are_not_there_are_named(alula, tmp_path, capsys):
    for words in (("--answers", str(tmp_path / "none.json")), ("--palette", str(tmp_path / "none.json"))):
        code, _, err = alula(PLAIN, *words)
        assert code == 2
        assert "none.json" in err
    assert tree.main([str(tmp_path / "none.xml")]) == 2
    assert "none.xml:1:1: can't be read: No such file" in capsys.readouterr().err
    for wrong in ("-1", "3"):
        code, _, err = alula(PLAIN, "--ticks", wrong)
        assert code == 2
        assert "goes with --answers" in err


# --- drawings ------------------------------------------------------------------------------------------------------------


def test_a_tree_is_drawn_as_text_with_names_ports_and_conditions(alula):
    code, out, err = alula(FILE)
    assert (code, err) == (0, "")
    en = "\N{EN SPACE}"
    assert out.splitlines() == [
        "mission.xml: Main",
        "? Fallback",
        "├─ → fly (Sequence)",
        f"│  ├─ there (goto){en}target={{waypoint}}{en}speed=1.0{en}_skipIf: near == 1",
        f"│  └─ ↳ looking (Look){en}at={{waypoint}}",
        "│     └─ camera.look",
        "└─ give_up",
    ]


def test_the_picture_says_the_same(alula, tmp_path):
    assert alula(FILE, "--svg", str(tmp_path / "tree.svg"))[0] == 0
    picture = ET.fromstring((tmp_path / "tree.svg").read_text())  # noqa: S314 - our own
    said = ["".join(text.itertext()) for text in picture.iter("{http://www.w3.org/2000/svg}text")]
    assert {"→ fly (Sequence)", "there (goto)", "_skipIf: near == 1", "↳ looking (Look)", "give_up"} <= set(said)
    assert any("mission.xml:5" in "".join(title.itertext()) for title in picture.iter("{http://www.w3.org/2000/svg}title"))


def test_a_robots_own_action_is_no_skill(alula):
    (root,) = lines(alula(PLAIN.replace("<a/>", "<uav.NextWaypoint/>"), "--json"))
    assert [(one["kind"], one["skill"]) for one in root["children"]] == [("action", ""), ("action", "")]


def test_as_json_each_node_has_its_type_ports_conditions_and_line(alula):
    (root,) = lines(alula(FILE, "--json"))
    leaf = root["children"][0]["children"][0]
    assert {name: leaf[name] for name in ("name", "kind", "skill", "type", "ports", "conditions", "place")} == {
        "name": "there",
        "kind": "skill",
        "skill": "navigation.goto",
        "type": "navigation.goto",
        "ports": {"target": "{waypoint}", "speed": "1.0"},
        "conditions": {"_skipIf": "near == 1"},
        "place": "mission.xml:5",
    }
