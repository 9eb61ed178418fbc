"""Names and comments of written branches: an author's own words, and the models' as an author would put them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from repair_rovers import ERRAND, rover

from alula.prove.limits import Deadline
from alula.repair.branches import node
from alula.repair.composing import first_skills
from alula.repair.naming import Renaming, Vocabulary, chances, often_when, told_state
from alula.repair.repairing import Question, Search
from alula.repair.subject import Subject

SCENARIO = "about: {name}\nmission: missions/{name}.xml\nskillsets: [base]\n"
OTHER = """<root BTCPP_format="4" main_tree_to_execute="other">
  <BehaviorTree ID="other">
    <Parallel name="careful" success_count="1" failure_count="1">
      <eyes.feel name="feel ahead"/>
      <Sequence name="slowly">
        <WaitFor name="the bumper feels" if="progress(eyes.feel) &gt;= 1"/>
        <base.creep name="creep along" to="2"/>
      </Sequence>
    </Parallel>
  </BehaviorTree>
</root>
"""


def branch(subject: Subject, fault: str) -> str:
    """Return what is written for a fault, a node a line, without indentation."""
    answer = Search(subject, Question(fault), Deadline.after(600.0), print).run()
    assert answer.repair is not None
    return answer.repair.branch.as_xml().replace("  ", "")


def test_a_branch_has_the_words_of_the_models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    subject = Subject.read(rover(tmp_path, ERRAND.replace("PORTS", "")), print)
    assert branch(subject, "laser") == WRITTEN


WRITTEN = """<!-- The laser is broken: creep. 'feel' is the touch that creep needs. -->
<BehaviorTree ID="creep_instead">
<Sequence name="creep instead">
<ScriptCondition name="the laser is broken" code="eyes.laser == BROKEN"/>
<Script name="degraded" code="@degraded := true"/>
<Parallel name="creep with touch" success_count="1" failure_count="1">
<eyes.feel name="feel"/>
<Sequence name="once there is touch">
<WaitFor name="there is touch" if="progress(eyes.feel) &gt;= 1"/>
<base.creep name="creep" to="{goal}"/>
</Sequence>
</Parallel>
</Sequence>
</BehaviorTree>"""


def test_the_robots_other_missions_say_what_things_are_called(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    path = rover(tmp_path, ERRAND.replace("PORTS", ""))
    (tmp_path / "missions/other.xml").write_text(OTHER)
    (tmp_path / "missions/broken.xml").write_text("<root")
    (tmp_path / "scenarios").mkdir()
    for name in ("main", "other", "broken"):
        (tmp_path / f"scenarios/{name}.yaml").write_text(SCENARIO.format(name=name))
    text = branch(Subject.read(path, print), "laser")
    assert '<eyes.feel name="feel ahead"/>' in text
    assert '<WaitFor name="the bumper feels" ' in text
    assert '<base.creep name="creep along" to="{goal}"/>' in text
    assert '<Parallel name="creep along with touch" ' in text


def test_a_skill_that_nobody_names_is_called_by_its_name() -> None:
    words = Vocabulary([node("base__creep", name="creep along"), node("base__creep", name="again"), node("base__dock")])
    assert [words.leaf(one) for one in ("base.creep", "base.dock", "base.follow_corridor")] == ["creep along", "dock", "follow corridor"]


@pytest.mark.parametrize(
    ("old", "new", "text", "renamed"),
    [
        ("zed_depthmap", "lidar_depthmap", "ZED sees", "LiDAR sees"),
        ("goto_straight", "goto", "fly straight", "fly"),
        ("follow_corridor", "drive_to", "along the corridor", "along the corridor"),
        ("goto", "goto_straight", "go", "go"),
    ],
)
def test_one_word_alone_takes_the_place_of_another(old: str, new: str, text: str, renamed: str) -> None:
    assert Renaming(old, new, ["the LiDAR watches"]).name(text) == renamed


@pytest.mark.parametrize(
    ("resource", "state", "told"),
    [
        ("base.pose_status", "GOOD", "the pose is good"),
        ("power.charger", "ON", "the charger is on"),
        ("perception.laser", "OK", "the laser is OK"),
        ("navigation.SDK_authority", "NOT_OURS", "the SDK authority is not ours"),
        ("people.visitors", "LAGGING", "the visitors are lagging"),
        ("base.chassis", "HOT", "the chassis is hot"),
        ("base.gps", "LOST", "the gps is lost"),
    ],
)
def test_a_state_is_told_as_a_person_tells_it(resource: str, state: str, told: str) -> None:
    assert told_state(resource, state) == told


def test_chances_are_counted_in_words() -> None:
    assert [chances(2, "dock"), chances(3), chances(4)] == ["two chances to dock", "three chances", "4 chances"]
    assert [chances(3, "to the valve"), chances(2, "Back home")] == ["three chances to get to the valve", "two chances to get Back home"]
    assert chances(3, "go_to_dock") == "three chances to go to dock"
    assert often_when(2, ["BLOCKED", "TIMED_OUT"]) == "twice when blocked or timed out"


@pytest.mark.parametrize(
    ("tree", "first"),
    [
        (node("Sequence", node("Script"), node("a__x"), node("a__y")), ["a.x"]),
        (node("Parallel", node("a__x"), node("Sequence", node("WaitFor"), node("a__y"))), ["a.x"]),
        (node("Parallel", node("a__x"), node("Sequence", node("uav__Next"), node("a__y"))), ["a.x", "a.y"]),
        (node("Sequence", node("Stays"), node("a__x")), []),
        (node("Until", node("Sequence", node("ForceSuccess", node("a__y")), node("a__x"))), ["a.y"]),
    ],
)
def test_skills_that_start_at_once_are_those_that_nothing_is_waited_for_before(tree: object, first: Sequence[str]) -> None:
    assert sorted(first_skills(tree, {"a.x", "a.y"})) == first  # type: ignore[arg-type]
