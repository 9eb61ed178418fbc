"""The public API: its names, where they say that they come from, and what a program does with them."""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import alula
from alula import AlulaError, Mission, Outcome, Record, Severity, check_files, load_behaviour, load_skillset, open_run, parse_skillset
from alula.common.public import lazy_names
from alula.trees import FAILURE, RUNNING, STRING, SUCCESS, Action, Answer, Condition, input_port, register, script_port

ROOT = Path(__file__).resolve().parents[3]
MODULES = ("alula", "alula.parts", "alula.trees")
FIGURES_OF = {"Answer", "Entry", "Inputs"}
"""Aliases of types."""
OF_PY_TREES = {"Status", "FAILURE", "IDLE", "RUNNING", "SUCCESS", "SKIPPED"}

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
MISSION = """
<root BTCPP_format="4" main_tree_to_execute="go">
  <BehaviorTree ID="go"><Sequence><test.Ready word="{word}"/><door.open name="open it"/></Sequence></BehaviorTree>
  <TreeNodesModel><SubTree ID="go"><input_port name="word"/></SubTree></TreeNodesModel>
</root>
"""
MOCK = "skills: {door.open: {delay: 2}}\nfaults: {jam: {set: {door.leaf: JAMMED}}}\n"


@register("test.Ready")
class Ready(Condition):
    """Succeeds when the word is the right one."""

    ports = (input_port("word", STRING),)

    def update(self) -> Answer:
        return SUCCESS if self.get("word") == "sesame" else FAILURE


@pytest.fixture
def door(tmp_path):
    for name, text in (("door.skill", DOOR), ("go.xml", MISSION), ("mock.yaml", MOCK)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def mission_of(folder, word="sesame"):
    skillset = load_skillset(folder / "door.skill")
    return Mission.from_file(folder / "go.xml", [skillset], behaviour=[folder / "mock.yaml"], nodes=[Ready], inputs={"word": word})


# --- names --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("module", MODULES)
def test_what_a_type_checker_sees_is_what_is_there(module):
    loaded = importlib.import_module(module)
    tree = ast.parse(Path(loaded.__file__).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"]
    seen = {node.module: tuple(alias.name for alias in node.names) for node in block.body}
    assert {place: set(names) for place, names in seen.items()} == {place: set(names) for place, names in loaded._DEFINED_IN.items()}
    names = {name for several in seen.values() for name in several}
    assert set(loaded.__all__) == names
    assert names <= set(dir(loaded))
    for name in names:
        assert getattr(loaded, name) is getattr(importlib.import_module(next(p for p, some in seen.items() if name in some)), name)


@pytest.mark.parametrize(("module", "name"), [(module, name) for module in MODULES for name in importlib.import_module(module).__all__])
def test_a_class_says_where_users_import_it_from(module, name):
    thing = getattr(importlib.import_module(module), name)
    if not (inspect.isclass(thing) or inspect.isfunction(thing)) or name in FIGURES_OF | OF_PY_TREES:
        return
    assert (thing.__module__, thing.__qualname__) == (module, name)
    assert inspect.getdoc(thing)
    assert pickle.loads(pickle.dumps(thing)) is thing  # noqa: S301 - our own


def test_an_error_is_called_by_its_public_name(tmp_path):
    with pytest.raises(AlulaError) as raised:
        open_run(tmp_path)
    assert isinstance(raised.value, AlulaError)
    with pytest.raises(AttributeError, match="module 'alula' has no attribute 'Skilset'"):
        _ = alula.Skilset


def test_a_name_that_is_to_go_warns_and_is_the_new_one():
    look, names = lazy_names("alula", {}, {}, renamed={"Skilset": "Skillset"})
    with pytest.warns(
        DeprecationWarning, match="alula.Skilset is alula.Skillset now; the old name goes with the next minor version"
    ) as told:
        assert look("Skilset") is alula.Skillset
    assert told[0].filename == __file__
    assert "Skilset" not in names()


def test_the_import_loads_nothing_of_the_library():
    code = (
        "import sys, alula, json; print(json.dumps(sorted(m for m in sys.modules if m.partition('.')[0] in {'alula', 'yaml', 'py_trees'})))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == ["alula", "alula.common", "alula.common.public"]


# --- models -------------------------------------------------------------------------------------------------------------


def test_a_model_is_read_from_a_file_or_a_text(door):
    assert load_skillset(door / "door.skill") == load_skillset(door / "door.skill")
    assert [one.name for one in parse_skillset(DOOR).skills] == ["open"]
    with pytest.raises(AlulaError, match=r"here\.skill:1:1: "):
        parse_skillset("skilset door {}", "here.skill")
    with pytest.raises(AlulaError, match="one skillset is needed"):
        parse_skillset(DOOR + DOOR.replace("skillset door", "skillset gate"))


def test_check_tells_findings_and_counterexamples(door):
    assert [one for one in check_files(door / "door.skill") if one.severity is Severity.ERROR] == []
    text = DOOR.replace("  skill open {", "  property stays: never (open running and leaf == OPEN)\n  skill open {", 1)
    text = text.replace("leaf != JAMMED", "leaf != SHUT")
    (door / "door.skill").write_text(text, encoding="utf-8")
    lines: list[str] = []
    found = check_files(door / "door.skill", on_progress=lines.append)
    assert {one.span.file for one in found} == {str(door / "door.skill")}
    assert any(one.counterexample.steps for one in found)
    assert not any(one.counterexample.steps for one in check_files(door / "door.skill", proofs=False))


def test_the_old_name_of_a_parameter_warns_and_is_taken(door):
    lines: list[str] = []
    with pytest.deprecated_call(match=r"check_files\(tell=...\) is check_files\(on_progress=...\) now"):
        assert check_files(door / "door.skill", proofs=False, tell=lines.append) == check_files(door / "door.skill", proofs=False)


def test_missions_are_checked_with_the_robot_that_is_named():
    rover = ROOT / "examples/rover"
    assert [one for one in check_files(rover / "missions/patrol.xml", robot=rover, proofs=False) if one.severity is Severity.ERROR] == []
    assert [one for one in check_files(rover / "missions/patrol.xml", robot=ROOT, proofs=False) if one.severity is Severity.ERROR]
    with pytest.raises(AlulaError, match=r"robot\.yaml"):
        check_files(robot=ROOT / "docs")


# --- missions and runs --------------------------------------------------------------------------------------------------


def test_a_mission_of_a_file_is_run_over_mocks(door):
    done = mission_of(door).run()
    assert (done.outcome, done.reason, done.end.outcome) == (Outcome.ACCOMPLISHED, "", Outcome.ACCOMPLISHED)
    assert [(one.skill, one.result) for one in done.ended] == [("open", "OPENED")]
    (execution,) = done.executions
    assert execution.ended_s - execution.started_s == pytest.approx(2.0, abs=0.1)
    assert mission_of(door, "barley").run().outcome is Outcome.GIVEN_UP
    jammed = mission_of(door).run("jam@1")
    assert (jammed.outcome, jammed.state("door", "leaf")) == (Outcome.GIVEN_UP, "JAMMED")
    assert [one.result for one in jammed.ended] == ["not_jammed"]


def test_what_a_mission_can_not_be_given_is_refused_before_it_begins(door):
    with pytest.raises(AlulaError, match="there is no fault 'fire'"):
        mission_of(door).run("fire@1", out=door / "run")
    assert not (door / "run").exists()
    with pytest.raises(AlulaError, match="needs `word`"):
        Mission.from_file(door / "go.xml", [load_skillset(door / "door.skill")], nodes=[Ready])
    with pytest.raises(AlulaError, match=r"go\.xml:\d+:\d+: unknown node 'test\.Ready'"):
        Mission.from_file(door / "go.xml", [load_skillset(door / "door.skill")], inputs={"word": ""})
    with pytest.raises(AlulaError, match="is not an empty folder"):
        mission_of(door).run(out=door)
    with pytest.raises(AlulaError, match="belongs to no robot"):
        mission_of(door).odds()
    with pytest.raises(AlulaError, match="there is no scenario 'delivr'"):
        Mission.load("delivr", ROOT / "examples/rover")
    with pytest.raises(AlulaError, match=r"fault 'laser:frozn': laser can't be 'frozn'; .*did you mean `frozen`\?"):
        Mission.load("patrol", ROOT / "examples/rover").run("laser:frozn")


def test_a_run_is_opened_held_against_the_models_and_decided_again(tmp_path):
    rover = ROOT / "examples/rover"
    flown = Mission.load("patrol", rover).run("laser@20", seed=2, out=tmp_path / "run")
    run = open_run(tmp_path / "run", rover)
    assert (run.outcome, run.request["seed"], run.request["faults"]) == (flown.outcome, 2, ["laser@20"])
    assert [fault.sensor for fault in run.faults] == ["laser"]
    assert [(one.sequence, one.stamp_ns, one.skillset) for one in run.record.events] == [
        (one.sequence, one.stamp_ns, one.skillset) for one in flown.events
    ]
    assert [(one.id, one.result, one.ended_ns) for one in run.record.executions] == [
        (one.id, one.result, one.ended_ns) for one in flown.executions
    ]
    assert len(run.record) == len(list(run.record)) == sum(len(run.record.topic(topic)) for topic in run.record.topics)
    assert run.conform().conforms
    again = run.replay()
    assert again.difference is None
    assert [one.id for one in again.decisions] == [entry.value["id"] for entry in run.record.decisions]
    with pytest.raises(AlulaError, match="no parameter"):
        run.replay(settings={"no_such": 1.0})
    with pytest.raises(AlulaError, match="can't be read"):
        _ = run.summary
    with pytest.raises(AlulaError, match="there is no such record"):
        Record(tmp_path)


def test_behaviour_may_be_given_as_a_value(door):
    skillset = load_skillset(door / "door.skill")
    behaviour = load_behaviour([str(door / "mock.yaml")], [skillset])
    mission = Mission.from_file(door / "go.xml", [skillset], behaviour=behaviour, nodes=[Ready], inputs={"word": "sesame"})
    assert mission.run().outcome is Outcome.ACCOMPLISHED


# --- nodes --------------------------------------------------------------------------------------------------------------


class Unregistered(Ready):
    """Has no name of its own."""


class Scripted(Action):
    """Succeeds when its script holds; reads it once."""

    ports = (script_port("if"),)

    def setup(self) -> None:
        self._script = self.script("if", "true")

    def on_start(self) -> Answer:
        return self.on_running()

    def on_running(self) -> Answer:
        return SUCCESS if self._script.holds() else RUNNING


def test_a_class_that_is_not_registered_has_its_own_name_and_a_script_is_read_with_the_tree(door):
    skillsets = [load_skillset(door / "door.skill")]
    text = MISSION.replace('<test.Ready word="{word}"/>', '<Unregistered word="sesame"/><Scripted if="door.leaf == SHUT"/>')
    (door / "go.xml").write_text(text, encoding="utf-8")
    make = lambda: Mission.from_file(door / "go.xml", skillsets, nodes=[Unregistered, Scripted, Ready], inputs={"word": ""})  # noqa: E731
    assert make().run().outcome is Outcome.ACCOMPLISHED
    (door / "go.xml").write_text(text.replace("door.leaf == SHUT", "door.leaf =="), encoding="utf-8")
    with pytest.raises(AlulaError, match=r"go\.xml:\d+:\d+: "):
        make().run()
