"""A mission without any robot: drawn, and ticked by scripted answers."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import pytest

pytest.importorskip("py_trees")

from alula.cli import tree
from alula.report.page.embedded import entries_inside
from alula_testing.waits import until as wait_until

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


# --- context -------------------------------------------------------------------------------------------------------------

CUSTOM = """<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">
  <Sequence name="fly">{}</Sequence></BehaviorTree>
  <TreeNodesModel>
    <Action ID="Find"><output_port name="goal" type="int"/><input_port name="at"/></Action>
    <Decorator ID="Hold"/><Control ID="Choose"/>
    <SubTree ID="Main"><input_port name="tries" default="3"/></SubTree>
  </TreeNodesModel></root>"""


def roots(done) -> list[str]:
    return [one["root"] for one in lines(done)]


def test_entries_and_enums_are_there_before_the_first_tick(alula):
    text = CUSTOM.format('<ScriptCondition code="near + tries == LEADER"/>')
    answers = {"entries": {"near": 2}, "enums": {"LEADER": 5}}
    assert roots(alula(text, "--ticks", "1", "--json", answers=answers)) == ["SUCCESS"]
    assert roots(alula(text, "--ticks", "1", "--json", answers={**answers, "entries": {"near": 2, "tries": 4}})) == ["FAILURE"]


def test_a_leaf_writes_its_outputs(alula):
    text = CUSTOM.format('<Find goal="{goal}" at="x"/><ScriptCondition code="goal == 7"/>')
    once = {"answer": "SUCCESS", "outputs": {"goal": "7"}}
    done = alula(
        text, "--ticks", "2", "--json", "--trace", answers={"answers": {"Find": [once, {"answer": "SUCCESS", "outputs": {"goal": 8}}]}}
    )
    first, second = lines(done)
    assert (first["root"], first["written"], second["root"], second["written"]) == ("SUCCESS", {"goal": 7}, "FAILURE", {"goal": 8})


def test_a_trace_tells_answers_halts_and_what_was_written(alula):
    text = CUSTOM.format('<Find name="find it" goal="{goal}" at="x"/><b/>')
    found = {"answer": "SUCCESS", "outputs": {"goal": "7"}}
    code, out, _ = alula(text, "--ticks", "1", "--trace", answers={"answers": {"find it": [found], "b": ["RUNNING"]}})
    assert code == 0
    assert out.splitlines() == [
        "tick 1: RUNNING, start find it, start b",
        "  fly: IDLE -> RUNNING",
        "  find it: IDLE -> SUCCESS",
        "  b::3: IDLE -> RUNNING",
        "  goal := 7",
    ]
    code, out, _ = alula(PLAIN, "--ticks", "2", "--trace", answers={"a": ["SUCCESS", "FAILURE"], "b": ["RUNNING"]})
    assert "  b::3: RUNNING -> IDLE" in out.splitlines()


def test_other_nodes_stand_in_for_those_that_only_a_program_has(alula):
    held = CUSTOM.format("<Hold><a/></Hold>")
    answers = {"a": ["FAILURE", "FAILURE", "SUCCESS"]}
    for stand_in, expected in (("pass-through", "FAILURE"), ("Inverter", "SUCCESS"), ("retry 2", "RUNNING")):
        found = roots(alula(held, "--ticks", "1", "--json", answers={"answers": answers, "stand_ins": {"Hold": stand_in}}))
        assert found == [expected], stand_in
    chosen = CUSTOM.format("<Choose><a/><b/></Choose>")
    for stand_in, expected in (("Fallback", "SUCCESS"), ("Sequence", "FAILURE")):
        said = {"answers": {"a": ["FAILURE"], "b": ["SUCCESS"]}, "stand_ins": {"Choose": stand_in}}
        assert roots(alula(chosen, "--ticks", "1", "--json", answers=said)) == [expected]


def test_chance_gives_what_the_seed_says(alula):
    text = CUSTOM.format("<IsReady/><b/>")

    def ticked(seed: str) -> list[str]:
        return roots(alula(text, "--ticks", "40", "--json", "--seed", seed, answers={"*": ["ANY"]}))

    assert ticked("1") == ticked("1") != ticked("2")
    assert set(ticked("1")) == {"RUNNING", "SUCCESS", "FAILURE"}


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"entries": {}, "anwsers": {}}, "'anwsers' is no section; there are answers, entries, enums, stand_ins"),
        ({"entries": {}, "answers": []}, "the section 'answers' is no object"),
        ({"stand_ins": {"Hold": 1}}, "stand_ins: 'Hold' is 1; write \"pass-through\", "),
        ({"stand_ins": {"Hold": "Fallbak"}}, "'Fallbak' can't stand in for Hold; write \"pass-through\", "),
        ({"stand_ins": {"Hold": "retry"}}, "'retry' can't stand in for Hold"),
        ({"stand_ins": {"Hold": "IfThenElse"}}, "IfThenElse takes 2 to 3 children, and Hold has 1 at "),
        ({"stand_ins": {"Hol": "Inverter"}}, "no node with children of the type 'Hol'; did you mean Hold?"),
        ({"enums": {"A B": 1}}, "enums: 'A B' is no name that a script can use"),
        (
            {"answers": {"find": [{"answer": "SUCCESS", "outputs": {"goa": 1}}]}},
            "the port 'goa', which is no output of it; did you mean goal?",
        ),
        (
            {"answers": {"find": [{"answer": "SUCCESS", "outputs": {"at": 1}}]}},
            "the port 'at', which is no output of it; its outputs are goal",
        ),
        ({"answers": {"find": [{"answer": "SUCCESS", "output": {}}]}}, 'is no answer; write {"answer": "SUCCESS", "outputs": {"port": 1}}'),
        ({"answers": {"*": ["ANY"]}}, "nothing here ticks a 'Hold'; say in the answers what stands in"),
        ({"stand_ins": {"Hold": "Inverter"}, "answers": {"find": [{"answer": "FAILURE", "outputs": {"goal": "x"}}]}}, "the port 'goal': "),
    ],
)
def test_wrong_sections_are_told_in_a_line(alula, answers, words):
    text = CUSTOM.format('<Hold><Find name="find" goal="{goal}" at="x"/></Hold>')
    code, out, err = alula(text, "--json", answers=answers)
    assert (code, out) == (2, "")
    assert err.startswith("alula tree: ")
    assert err.count("\n") == 1
    assert words in err


def test_options_of_ticks_need_answers(alula, tmp_path):
    for words in (("--trace",), ("--seed", "1"), ("--html", str(tmp_path / "x.html"))):
        code, _, err = alula(PLAIN, *words)
        assert code == 2
        assert f"{words[0]}: goes with --answers FILE" in err


def test_a_page_has_a_moment_for_each_tick(alula, tmp_path):
    page = tmp_path / "ticks.html"
    assert alula(PLAIN, "--ticks", "2", "--html", str(page), answers={"a": ["SUCCESS"], "b": ["RUNNING", "SUCCESS"]})[0] == 0
    told = {topic: value for topic, _, value in entries_inside(page.read_text())}
    assert told["/run"] == {"name": "mission.xml: Main"}
    assert told["/ticked"] == {"number": 2, "root": "SUCCESS", "text": "tick 2: SUCCESS, start a, tick b"}
    assert [name for _, _, name, *_ in told["/tree"]] == ["ReactiveSequence", "a", "b"]
    assert told["/nodes"] == [[0, "SUCCESS", ""], [2, "SUCCESS", ""]]


def test_a_page_has_the_ticks_before_an_error(alula, tmp_path):
    page = tmp_path / "ticks.html"
    text = CUSTOM.format('<a/><ScriptCondition code="nothing == 1"/>')
    assert alula(text, "--html", str(page), answers={"a": ["RUNNING", "SUCCESS"]})[0] == 2
    assert [value["number"] for topic, _, value in entries_inside(page.read_text()) if topic == "/ticked"] == [1]


def test_a_reviewer_steps_through_the_ticks(alula, tmp_path, browser):
    page = tmp_path / "ticks.html"
    alula(PLAIN, "--ticks", "3", "--html", str(page), answers={"a": ["SUCCESS", "SUCCESS", "FAILURE"], "b": ["RUNNING"]})
    browser.get(page.as_uri())
    wait_until(lambda: "3 times" in browser.find_element("id", "headline").text, "the page tells of its ticks")
    assert not browser.find_element("id", "map-card").is_displayed()
    wait_until(lambda: "✗ failed" in browser.find_element("id", "tree").text, "the last tick failed")
    browser.find_element("id", "previous").click()
    wait_until(lambda: browser.find_element("id", "at").text.endswith("tick 2: RUNNING, start a, tick b"), "the tick before is shown")
    assert "✗ failed" not in browser.find_element("id", "tree").text
