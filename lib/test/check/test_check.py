"""Checks of missions: each finding's example, what must not be found, and files that mean no good."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest

from alula.check.findings import findings_of
from alula.cli.check import main
from alula.language.codes import MISSION_CODES
from alula.language.errors import Severity
from alula.language.models import ModelFile, check_texts
from finding_pages.examples import MISSIONS, examples
from finding_pages.mission_checks import NAME, ROBOT, found_in, page, whole

EXAMPLES = examples(MISSIONS)
PAGE = next(p / "docs/reference" / NAME for p in Path(__file__).resolve().parents if (p / "docs/reference" / NAME).is_file())
MUTATIONS = 1000

SOUND = """<?xml version="1.0"?>
<root BTCPP_format="4" main_tree_to_execute="mission">
  <!-- every kind of thing that a mission has -->
  <BehaviorTree ID="mission">
    <Fallback name="mission">
      <Sequence>
        <Script code="tries := 0; mode := 'fast'"/>
        <SubTree ID="leg" duration="{time}" times="3" _autoremap="false"/>
        <SubTree ID="turning" _autoremap="true"/>
        <RetryUntilSuccessful num_attempts="3">
          <drone.hover duration="{time}" outcome="{why}" _skipIf="tries &gt; 2" _onSuccess="tries += 1" _onFailure="tries = tries + 1"/>
        </RetryUntilSuccessful>
        <ReactiveSequence>
          <ScriptCondition code="drone.flight == IN_AIR &amp;&amp; !running(drone.turn)"/>
          <Parallel success_count="1" failure_count="1">
            <drone.watch name="watch"/>
            <Sleep msec="100"/>
          </Parallel>
        </ReactiveSequence>
        <Switch2 variable="{mode}" case_1="fast" case_2="slow">
          <AlwaysSuccess/><AlwaysSuccess/><AlwaysFailure/>
        </Switch2>
        <SetBlackboard value="1;2" output_key="queue"/>
        <LoopInt queue="{queue}" value="{item}"><ScriptCondition code="item &gt; 0"/></LoopInt>
      </Sequence>
      <ForceFailure>
        <Sequence name="give up"><ScriptCondition code="why != 'DONE'"/><drone.hover duration="5"/></Sequence>
      </ForceFailure>
    </Fallback>
  </BehaviorTree>
  <BehaviorTree ID="leg">
    <ForceSuccess><Repeat num_cycles="{times}"><drone.hover duration="{duration}" success="DONE"/></Repeat></ForceSuccess>
  </BehaviorTree>
  <BehaviorTree ID="turning">
    <Sequence>
      <ForceSuccess><drone.turn angle="0.5" _skipIf="mode == 'slow'"/></ForceSuccess>
      <Script code="_own := 1; tries = _own"/>
    </Sequence>
  </BehaviorTree>
  <TreeNodesModel>
    <SubTree ID="mission"><input_port name="time" type="double"/></SubTree>
    <SubTree ID="leg"><input_port name="duration"/><input_port name="times"/></SubTree>
  </TreeNodesModel>
</root>
"""


@pytest.fixture(scope="module")
def robot():
    (file,) = check_texts([ModelFile("robot.rl", ROBOT)])
    assert file.findings == []
    return file.skillsets


def node(text, robot, path="mission.xml"):
    return findings_of(path, whole(text).encode(), robot)


def codes(findings):
    return [finding.code for finding in findings]


def test_each_code_has_an_example():
    assert set(EXAMPLES) == set(MISSION_CODES)
    assert all(example.cure and bool(example.broken) != bool(example.files) for example in EXAMPLES.values())


@pytest.mark.parametrize("code", [code for code, example in EXAMPLES.items() if example.broken])
def test_broken_and_mended_mission(code):
    broken = found_in(EXAMPLES[code].broken)
    assert code in codes(broken)
    assert len(broken) <= 2
    assert all(finding.span.line and finding.source_line for finding in broken)
    assert found_in(EXAMPLES[code].mended) == []


def test_the_page_is_written_of_rules_and_examples():
    """Mend with `python -m finding_pages.mission_checks docs/reference`."""
    assert PAGE.read_text() == page(PAGE.read_text())


def test_a_sound_mission_has_no_findings(robot):
    assert [finding.render() for finding in findings_of("mission.xml", SOUND.encode(), robot)] == []


PLACES = (
    ('<ScriptCondition code="1 &lt; 2 &amp;&amp; drone.flight == NOWHERE"/>', "ALU615", "NOWHERE", "IN_AIR"),
    ('<ScriptCondition code="running(drone.hovr)"/>', "ALU615", "drone.hovr", "drone.hover"),
    ('<ScriptCondition code="flying(drone.hover)"/>', "ALU615", "flying", "running"),
    ('<ScriptCondition code="drones.flight == IN_AIR"/>', "ALU615", "drones.flight", "drone"),
    ('<ScriptCondition code="drone.fligt == IN_AIR"/>', "ALU615", "drone.fligt", "flight"),
    ('<Script code="a := 1 +* 2"/>', "ALU614", "*", ""),
    ('<Script code="b := a"/>', "ALU607", "a", "write it before"),
    ('<ForceSuccess><drone.hover duration="2 m"/></ForceSuccess>', "ALU606", "2 m", "number of s"),
)


@pytest.mark.parametrize(("text", "code", "shown", "cure"), PLACES)
def test_a_finding_stands_at_its_column(text, code, shown, cure, robot):
    (finding,) = node(text, robot)
    assert finding.code == code
    assert finding.source_line[finding.span.column - 1 : finding.span.end_column - 1] == shown
    assert cure in finding.hint


FOUND = (
    # Entries through subtrees: what is remapped is one entry, what is not is another.
    ('<Sequence><Script code="x := 1"/><SubTree ID="in" y="{x}"/></Sequence>', '<ScriptCondition code="y == 1"/>', []),
    ('<Sequence><Script code="x := 1"/><SubTree ID="in"/></Sequence>', '<Script code="z := x"/>', ["ALU607"]),
    ('<Sequence><Script code="x := 1"/><SubTree ID="in" _autoremap="1"/></Sequence>', '<ScriptCondition code="x == 1"/>', []),
    ('<Sequence><Script code="_x := 1"/><SubTree ID="in" _autoremap="1"/></Sequence>', '<Script code="z := _x"/>', ["ALU607"]),
    ('<Sequence><Script code="x := 1"/><SubTree ID="in"/></Sequence>', '<ScriptCondition code="@x == 1"/>', []),
    ('<Sequence><SubTree ID="in" y="{x}"/><ScriptCondition code="x == 1"/></Sequence>', '<Script code="y := 1"/>', []),
    ('<Sequence><SubTree ID="in" y="{x}"/><Script code="x := 2"/></Sequence>', "<Script code=\"y := 'slow'\"/>", ["ALU608"]),
    # In the order of the file, but for nodes that tick their children at once.
    ('<Sequence><SubTree ID="in"/><Script code="a := b"/><Script code="b := 1"/></Sequence>', "<AlwaysSuccess/>", ["ALU607"]),
    ('<Parallel><SubTree ID="in"/><ScriptCondition code="b == 1"/><Script code="b := 1"/></Parallel>', "<AlwaysSuccess/>", []),
    # Never reached.
    ('<Sequence><Inverter><SubTree ID="in"/></Inverter><AlwaysSuccess/></Sequence>', "<AlwaysSuccess/>", ["ALU610"]),
    ('<Sequence><Inverter _skipIf="1"><SubTree ID="in"/></Inverter><AlwaysSuccess/></Sequence>', "<AlwaysSuccess/>", []),
    ('<IfThenElse><SubTree ID="in"/><AlwaysSuccess/><AlwaysFailure/></IfThenElse>', "<AlwaysFailure/>", ["ALU610"]),
    ('<Sequence><Repeat num_cycles="-1"><SubTree ID="in"/></Repeat><AlwaysSuccess/></Sequence>', '<Sleep msec="1"/>', ["ALU610"]),
    ('<Fallback><RetryUntilSuccessful num_attempts="-1"><SubTree ID="in"/></RetryUntilSuccessful><AlwaysSuccess/></Fallback>',
     "<AlwaysFailure/>", ["ALU610"]),
    # Several that run.
    ('<ReactiveFallback><Inverter><SubTree ID="in"/></Inverter><Sleep msec="1"/></ReactiveFallback>', '<Sleep msec="1"/>', ["ALU611"]),
    ('<ReactiveSequence><ScriptCondition code="1"/><SubTree ID="in"/></ReactiveSequence>', '<Sleep msec="1"/>', []),
    # Skills that run until they are interrupted.
    ('<ForceSuccess><Parallel><SubTree ID="in"/><Sleep msec="1"/></Parallel></ForceSuccess>', "<drone.watch/>", ["ALU612"]),
    ('<ForceSuccess><Parallel success_count="1"><SubTree ID="in"/><Sleep msec="1"/></Parallel></ForceSuccess>', "<drone.watch/>", []),
    ('<ForceSuccess><Repeat num_cycles="2"><SubTree ID="in"/></Repeat></ForceSuccess>', "<drone.watch/>", ["ALU612"]),
    # The same resource: surely, perhaps, and never at once.
    ('<ForceSuccess><Parallel><SubTree ID="in"/><drone.turn angle="1"/></Parallel></ForceSuccess>',
     '<drone.hover duration="1"/>', ["ALU613"]),
    ('<ForceSuccess><Parallel><SubTree ID="in"/><Sequence><Sleep msec="9"/><drone.turn angle="1"/></Sequence></Parallel></ForceSuccess>',
     '<drone.hover duration="1"/>', ["ALU613"]),
    ('<ForceSuccess><Parallel success_count="1"><SubTree ID="in"/><drone.turn angle="1"/></Parallel></ForceSuccess>', "<drone.watch/>", []),
    # Results.
    ('<Sequence><SubTree ID="in"/><AlwaysSuccess/></Sequence>', '<drone.hover duration="1"/>', ["ALU609"]),
    ('<Sequence><SubTree ID="in"/><AlwaysSuccess/></Sequence>', '<drone.hover duration="1" outcome="{why}" _post="why == \'DONE\'"/>', []),
    ('<Fallback><SubTree ID="in"/><AlwaysSuccess/></Fallback>', '<drone.hover duration="1"/>', []),
    ('<Fallback><AlwaysFailure/><SubTree ID="in"/></Fallback>', '<drone.hover duration="1"/>', ["ALU609"]),
)  # fmt: skip


@pytest.mark.parametrize(("outer", "inner", "expected"), FOUND)
def test_the_whole_tree_is_looked_at(outer, inner, expected, robot):
    trees = f'<BehaviorTree ID="main">{outer}</BehaviorTree><BehaviorTree ID="in">{inner}</BehaviorTree>'
    text = f'<root BTCPP_format="4" main_tree_to_execute="main">{trees}</root>'
    assert codes(findings_of("mission.xml", text.encode(), robot)) == expected


ASKED = (
    ("<ScriptCondition code=\"why == 'DOEN'\"/>", "DOEN", "did you mean `DONE`?"),
    ("<ScriptCondition code=\"'DOEN' != why\"/>", "DOEN", "did you mean `DONE`?"),
    (
        '<Switch2 variable="{why}" case_1="DONE" case_2="FALED"><AlwaysSuccess/><AlwaysFailure/><AlwaysSuccess/></Switch2>',
        "FALED",
        "`FAILED`",
    ),
)


@pytest.mark.parametrize(("asked", "text", "cure"), ASKED)
def test_an_end_that_no_skill_has_is_told_where_it_is_asked(asked, text, cure, robot):
    hover = '<ForceSuccess><drone.hover duration="1" outcome="{why}"/></ForceSuccess>'
    (finding,) = node(f"<Sequence>{hover}{asked}</Sequence>", robot)
    assert (finding.code, finding.severity) == ("ALU618", Severity.ERROR)
    assert finding.source_line[finding.span.column - 1 : finding.span.end_column - 1].strip("'") == text
    assert cure in finding.hint
    assert "drone.hover" in finding.message


NOT_ALONE = (
    "<Script code=\"why := 'DOEN'\"/>",
    "<Script code=\"why := drone.flight == IN_AIR ? 'DOEN' : ''\"/>",
    '<SetBlackboard value="DOEN" output_key="why"/>',
    '<SubTree ID="says" why="{why}"/>',
)


@pytest.mark.parametrize("more", NOT_ALONE)
def test_a_text_that_something_else_may_write_is_no_finding(more, robot):
    hover = '<ForceSuccess><drone.hover duration="1" outcome="{why}"/></ForceSuccess>'
    tree = f"<Sequence>{hover}{more}<ScriptCondition code=\"why == 'DOEN'\"/></Sequence>"
    says = '<BehaviorTree ID="says"><Script code="why := \'DOEN\'"/></BehaviorTree></root>'
    text = whole(tree).replace("</root>", says).replace("<root ", '<root main_tree_to_execute="mission" ')
    assert codes(findings_of("mission.xml", text.encode(), robot)) == []


UNREAD = (
    ('<Script code="tries := 0; tries += 1"/>', ["ALU624"]),
    ('<ForceSuccess><drone.hover duration="1" outcome="{why}"/></ForceSuccess>', ["ALU624"]),
    ('<Sequence><Script code="seen := 1"/><ScriptCondition code="sen == 1"/></Sequence>', ["ALU607"]),
    ('<Script code="degraded := true"/>', []),
    ('<Script code="flown := 1"/>', []),
    ('<Script code="seen := 1" _description="counts what was seen"/>', []),
    ('<Sequence><Script code="text := \'1 == 1\'"/><ScriptCondition code="{text}"/></Sequence>', []),
)


@pytest.mark.parametrize(("tree", "expected"), UNREAD)
def test_what_nothing_reads_is_told_once_and_where_nothing_else_is_wrong(tree, expected, robot):
    model = '<TreeNodesModel><SubTree ID="mission"><output_port name="flown" default="0"/></SubTree></TreeNodesModel></root>'
    found = findings_of("mission.xml", whole(tree).replace("</root>", model).encode(), robot)
    assert codes(found) == expected
    assert all(one.severity is Severity.WARNING for one in found if one.code == "ALU624")


DEFAULTS = (
    ('<SubTree ID="mission"><input_port name="far" default="0.6 km"/></SubTree>', "0.6 km", Severity.ERROR, "the number alone"),
    ('<SubTree ID="mission"><output_port name="far" default="none"/></SubTree>', "none", Severity.ERROR, "of the type double"),
    ('<SubTree ID="leg"><input_port name="times" type="int" default="2.5"/></SubTree>', "2.5", Severity.WARNING, "of the type int"),
)


@pytest.mark.parametrize(("model", "text", "severity", "cure"), DEFAULTS)
def test_a_default_that_is_no_value_of_its_port_is_told_with_its_place(model, text, severity, cure, robot):
    file = whole("<AlwaysSuccess/>").replace("</root>", f"<TreeNodesModel>{model}</TreeNodesModel></root>")
    (finding,) = findings_of("mission.xml", file.encode(), robot)
    assert (finding.code, finding.severity) == ("ALU605", severity)
    assert finding.source_line[finding.span.column - 1 :].strip('"').startswith((text, "default"))
    assert cure in finding.hint


def test_what_an_included_file_writes_another_mission_may_read(robot, tmp_path):
    tree = '<BehaviorTree ID="look"><Script code="@seen := 1"/></BehaviorTree>'
    (tmp_path / "more.xml").write_text(f'<root BTCPP_format="4">{tree}</root>')
    main = '<BehaviorTree ID="mission"><SubTree ID="look"/></BehaviorTree>'
    text = f'<root BTCPP_format="4" main_tree_to_execute="mission">{{}}{main}{{}}</root>'
    path = str(tmp_path / "mission.xml")
    assert codes(findings_of(path, text.format('<include path="more.xml"/>', "").encode(), robot)) == []
    assert codes(findings_of(path, text.format("", tree).encode(), robot)) == ["ALU624"]


def test_what_may_never_come_at_once_is_a_warning(robot):
    late = '<Sequence><Sleep msec="9"/><drone.turn angle="1"/></Sequence>'
    text = '<ForceSuccess><Parallel><drone.hover duration="1"/>{}</Parallel></ForceSuccess>'
    (sure,) = node(text.format('<drone.turn angle="1"/>'), robot)
    (perhaps,) = node(text.format(late), robot)
    assert (sure.severity, perhaps.severity) == (Severity.ERROR, Severity.WARNING)


def test_a_palette_tells_of_foreign_nodes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ALULA_ROBOT", raising=False)
    palette = tmp_path / "nodes.xml"
    palette.write_text(
        '<root BTCPP_format="4"><TreeNodesModel><Action ID="Drive"><input_port name="speed" type="double"/></Action>'
        "</TreeNodesModel></root>"
    )
    mission = tmp_path / "drive.xml"
    mission.write_text(whole('<Drive speed="1"/>'))
    assert main([str(mission)]) == 0  # a tree of another program, which may have such a node
    assert "warning ALU601: the node 'Drive' is not declared" in capsys.readouterr().out
    assert main([str(mission), "--palette", str(palette)]) == 0
    out = capsys.readouterr().out
    assert "note ALU715: 'Drive' may answer and write anything: the file declares it, and no class is known" in out
    assert out.endswith(f"{mission}: ok, 1 note\n")
    mission.write_text(whole('<Drive speed="fast"/>'))
    assert main([str(mission), "--palette", str(palette), "--json"]) == 1
    (finding,) = json.loads(capsys.readouterr().out)["files"][0]["findings"]
    assert (finding["code"], finding["line"], finding["column"]) == ("ALU605", 3, 19)


def nested(name, count):
    return f"<{name}>" * count + f"</{name}>" * count


TREE = '<root BTCPP_format="4" main_tree_to_execute="T0">{}</root>'
TWICE = '<BehaviorTree ID="T{}"><Sequence><SubTree ID="T{}"/><SubTree ID="T{}"/></Sequence></BehaviorTree>'
HOSTILE = {
    "nested": TREE.format(nested("Inverter", 500_000)),
    "long": TREE.format(" " * (17 << 20)),
    "entities": '<!DOCTYPE r [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]>'
    + TREE.format('<BehaviorTree ID="T0"><Script code="&b;"/></BehaviorTree>'),
    "outside": '<!DOCTYPE r SYSTEM "file:///etc/passwd">' + TREE.format(""),
    "cycle": TREE.format('<BehaviorTree ID="T0"><SubTree ID="T1"/></BehaviorTree><BehaviorTree ID="T1"><SubTree ID="T0"/></BehaviorTree>'),
    "include": TREE.format('<include path="mission.xml"/>'),
    "doubled": TREE.format(
        "".join(
            f'<BehaviorTree ID="T{n}"><Sequence><SubTree ID="T{n + 1}"/><SubTree ID="T{n + 1}"/></Sequence></BehaviorTree>'
            for n in range(60)
        )
        + '<BehaviorTree ID="T60"><AlwaysSuccess/></BehaviorTree>'
    ),
    "script": TREE.format('<BehaviorTree ID="T0"><Script code="' + "a:=1;" * 100_000 + '"/></BehaviorTree>'),
    "brackets": TREE.format('<BehaviorTree ID="T0"><Script code="' + "(" * 10_000 + '"/></BehaviorTree>'),
    "elements": TREE.format('<BehaviorTree ID="T0"><Sequence>' + "<AlwaysSuccess/>" * 100_000 + "</Sequence></BehaviorTree>"),
    "empty": "",
    "half": TREE[:30],
    "nothing": "\0\1\2",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_in_one_line(name, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ALULA_ROBOT", raising=False)
    path = tmp_path / "mission.xml"
    path.write_text(HOSTILE[name])
    (tmp_path / "robot.yaml").write_text("name: none\n")
    assert main([str(path)]) == 2
    told = [line for line in capsys.readouterr().err.splitlines() if str(path) in line]
    assert len(told) == 1
    assert len(told[0]) < 400


@pytest.mark.parametrize("content", [b"\xff\xfe<root/>", b"<root>\xe9</root>"])
def test_other_encodings_are_refused(content, tmp_path):
    (finding,) = findings_of("mission.xml", content, ())
    assert finding.code == "ALU004"


def test_what_is_no_file_is_refused(tmp_path, capsys):
    for path in (tmp_path / "missing.xml", Path("/dev/null/x.xml")):
        assert main([str(path)]) == 2
        assert "can't be read" in capsys.readouterr().err


def mutated(text, chance):
    """Return a text with a few slips: pieces that go, come twice, change places, or become something else."""
    for _ in range(chance.randrange(1, 5)):
        start = chance.randrange(len(text))
        end = min(len(text), start + chance.choice((1, 2, 5, 20, 80)))
        piece = text[start:end]
        words = ('"', "<", "/>", "{x}", "&amp;", "Sequence", "drone.turn", "-1", "success", "ID", "''", ":=", "\0", "é", "SubTree", ">")
        slips = ("", piece * 2, piece[::-1], chance.choice(words), chance.choice(words) + piece, piece.swapcase())
        text = text[:start] + chance.choice(slips) + text[end:]
    return text


def test_mutated_missions_are_right_or_have_findings(robot):
    chance = random.Random(77)  # noqa: S311
    seen = set()
    for _ in range(MUTATIONS):
        text = mutated(SOUND, chance)
        findings = findings_of("mission.xml", text.encode(), robot)
        lines = text.split("\n")
        for finding in findings:
            assert finding.message
            assert "\n" not in finding.message
            assert 1 <= finding.span.line <= len(lines), finding
            assert 1 <= finding.span.column < finding.span.end_column
            assert finding.code in MISSION_CODES
        seen.update(codes(findings))
    assert len(seen) > 10


def test_a_foreign_missions_entries_may_come_from_outside(robot, tmp_path):
    palette = tmp_path / "nodes.xml"
    palette.write_text('<root BTCPP_format="4"><TreeNodesModel/></root>')
    text = whole('<Script code="a := goal"/>').encode()
    (ours,) = findings_of("mission.xml", text, robot)
    (foreign,) = findings_of("mission.xml", text, robot, [palette])
    assert (ours.code, ours.severity) == ("ALU607", Severity.ERROR)
    assert (foreign.code, foreign.severity) == ("ALU607", Severity.WARNING)


@pytest.mark.parametrize("again", ['<Until if="1"><AlwaysSuccess/></Until>', '<RetryAfter if="1"><AlwaysFailure/></RetryAfter>'])
def test_decorators_that_run_a_child_again_take_several_ticks(again, robot):
    body = f'<ReactiveSequence><Sleep msec="1"/>{again}</ReactiveSequence>'
    assert "ALU611" in [one.code for one in findings_of("mission.xml", whole(body).encode(), robot)]


def test_what_waits_does_not_fail(robot):
    found = findings_of("mission.xml", whole('<Fallback><WaitFor if="1"/><AlwaysSuccess/></Fallback>').encode(), robot)
    assert "ALU610" in [one.code for one in found]


BESIDE = (
    # What the mission needs is asked before it begins, of what it is given alone.
    ("<AlwaysSuccess/>", "ready", '<Needs if="drone.flight == IN_AIR ? zz == 1 : false" otherwise="\'no\'"/>', [("ALU607", "zz", "error")]),
    ('<Script code="zz := 1"/>', "ready", '<Needs if="zz == 1" otherwise="\'no\'"/>', [("ALU607", "zz", "error")]),
    ("<AlwaysSuccess/>", "ready", '<Needs if="time &gt; 1" otherwise="\'no\'"/>', []),
    ("<AlwaysSuccess/>", "ready", '<Sequence><SubTree ID="in" x="{time}"/></Sequence>', []),
    ("<AlwaysSuccess/>", "ready", '<Sequence><SubTree ID="in"/></Sequence>', [("ALU607", "x", "error")]),
    # What stops the robot may begin at any moment.
    ("<AlwaysSuccess/>", "stop_here", '<ScriptCondition code="zz == 1"/>', [("ALU607", "zz", "error")]),
    ('<Script code="zz := 1"/>', "stop_here", '<ScriptCondition code="zz == 1"/>', [("ALU607", "zz", "warning")]),
    ('<Script code="zz := 1"/>', "stop_here", '<ScriptCondition code="zz := 2; zz == 1"/>', []),
    ("<AlwaysSuccess/>", "stop_here", '<ScriptCondition code="time == 1"/>', []),
    # One that is also a subtree of the main tree is ticked by itself all the same.
    ('<SubTree ID="stop_here" zz="1"/>', "stop_here", '<ScriptCondition code="zz == 1"/>', [("ALU607", "zz", "error")]),
    ('<SubTree ID="ready" zz="1"/>', "ready", '<Needs if="zz == 1" otherwise="\'no\'"/>', [("ALU607", "zz", "error")]),
    # Of another tree nobody knows who starts it; its types are looked at.
    ("<AlwaysSuccess/>", "other", '<Script code="a := zz"/>', []),
    ("<AlwaysSuccess/>", "other", '<Sequence><Script code="a := 1"/><Script code="a := \'b\'"/></Sequence>', [("ALU608", "a", "error")]),
)


@pytest.mark.parametrize(("main", "name", "body", "expected"), BESIDE)
def test_trees_beside_the_main_one_are_checked_like_it(main, name, body, expected, robot):
    text = f"""<root BTCPP_format="4" main_tree_to_execute="m"><BehaviorTree ID="m">{main}</BehaviorTree>
  <BehaviorTree ID="{name}">{body}</BehaviorTree>
  <BehaviorTree ID="in"><Needs if="x &gt; 1" otherwise="'no'"/></BehaviorTree>
  <TreeNodesModel><SubTree ID="m"><input_port name="time" type="double"/></SubTree></TreeNodesModel></root>"""
    found = findings_of("mission.xml", text.encode(), robot)
    shown = [one.source_line[one.span.column - 1 : one.span.end_column - 1] for one in found]
    assert [(one.code, text, one.severity.value) for one, text in zip(found, shown, strict=True)] == expected


def test_a_project_is_checked_and_a_robot_that_is_not_there_is_told_once(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ALULA_ROBOT", raising=False)
    (tmp_path / "one.xml").write_text(whole("<Inverter/>"))
    project = tmp_path / "all.btproj"
    project.write_text('<root BTCPP_format="4"><include path="one.xml"/></root>')
    assert main([str(project)]) == 1
    assert "ALU602" in capsys.readouterr().out
    (tmp_path / "one.xml").write_text(whole("<AlwaysSuccess/>"))
    assert main([str(project)]) == 0
    assert capsys.readouterr().err.count("no skills are known") == 1
