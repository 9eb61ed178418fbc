"""A fleet of two rovers: faults of its robots, who is safe, and a mission that goes on with the other one."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from repair_rovers import rover

from alula.prove.limits import Deadline
from alula.repair.judging import Judge
from alula.repair.repairing import Answer, Question, Search
from alula.repair.subject import Subject

FLEET = "name: both\nrobots: {scout: ../scout, carrier: ../carrier}\nparts: {missions: 'both_nodes:PART'}\npython: [python]\n"
NODES = """
from alula import parts
from alula.trees import Answer, FAILURE, SUCCESS, SyncAction, Condition, register, script_port


@register("both.Note")
class Note(SyncAction):
    ports = (script_port("what"),)

    def setup(self) -> None:
        self._what = self.script("what")

    def update(self) -> Answer:
        return SUCCESS if isinstance(self._what.run(), float) else FAILURE


PART = parts.MissionPart((Note,))
"""
LOOK = """<Parallel name="ROBOT looks" success_count="1" failure_count="1">
          <ROBOT_eyes.scan name="ROBOT's eyes"/>
          <ROBOT_base.drive name="ROBOT drives" to="1"/>
        </Parallel>"""
MISSION = """<root BTCPP_format="4" main_tree_to_execute="meet">
  <BehaviorTree ID="meet">
    <Fallback name="meet">
      <Sequence name="one, then the other">
        SCOUT
        MIDDLE
        CARRIER
      </Sequence>
      <AlwaysFailure name="given up"/>
    </Fallback>
  </BehaviorTree>
</root>
"""


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("scout", "carrier"):
        rover(tmp_path / name, "<root/>")
    for name, text in {"robot.yaml": FLEET, "python/both_nodes.py": NODES}.items():
        (tmp_path / "both" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "both" / name).write_text(text)
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path / "both"))
    return tmp_path / "both"


def subject(fleet: Path, middle: str = "", first: str = "scout", then: str = "carrier") -> Subject:
    parts = {"SCOUT": LOOK.replace("ROBOT", first), "MIDDLE": middle, "CARRIER": LOOK.replace("ROBOT", then).replace("drives", "comes")}
    text = MISSION
    for word, part in parts.items():
        text = text.replace(word, part)
    path = fleet / "missions/meet.xml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    return Subject.read(path, pytest.fail)


def repaired(of: Subject, *using: str) -> Answer:
    question = Question("scout_laser", most_faults=1, using=using, others=False)
    return Search(of, question, Deadline.after(600.0, quiet), quiet).run()


def quiet(_line: str) -> None:
    """Take no notice of progress."""


def test_faults_and_what_mocks_bring_about_are_the_robots(fleet: Path) -> None:
    one = subject(fleet)
    assert one.faults["scout_laser"].states == {"scout_eyes.laser BROKEN"}
    assert one.faults["carrier_dust"].later == {"carrier_eyes.bumper STUCK"}
    assert one.faults["carrier_person"].ends == {"carrier_base.drive BLOCKED"}
    assert ("carrier_base.place", "AWAY") in one.brought["carrier_base.drive"]


def test_each_robot_has_to_be_safe(fleet: Path) -> None:
    assert subject(fleet).at_rest == [[("scout_base.wheels", "FREE")], [("carrier_base.wheels", "FREE")]]


def test_the_robot_itself_goes_on_where_it_can(fleet: Path) -> None:
    answer = repaired(subject(fleet))
    assert answer.repair is not None
    assert "<scout_base.creep" in answer.repair.branch.as_xml()


def test_else_it_gives_up_its_task_and_the_other_one_goes_there(fleet: Path) -> None:
    answer = repaired(subject(fleet), "carrier_base.turn")
    assert answer.repair is not None
    assert answer.repair.branch.as_xml().splitlines()[-1] == '<Script name="not done: scout looks" code="@degraded := true"/>'
    assert "go on without 'scout looks'; carrier_base.drive comes later, for the same arrival. -->" in " ".join(answer.repair.text.split())


@pytest.mark.parametrize(("first", "then"), [("scout", "scout"), ("carrier", "scout")])
def test_it_is_not_left_out_where_no_other_robot_comes_later(fleet: Path, first: str, then: str) -> None:
    assert repaired(subject(fleet, first=first, then=then), "carrier_base.turn").repair is None


NOTED = '<both.Note name="note it" what="1.0"/>'
TOLD = """<ScriptCondition name="it is told" code="fresh('scout_power.battery')"/>"""


@pytest.mark.parametrize("middle", [NOTED, TOLD])
def test_what_nobody_knows_fails_nothing(fleet: Path, middle: str) -> None:
    """An action of the fleet's own is done, and data are told."""
    of = subject(fleet, middle)
    judge = Judge(of, Deadline.after(600.0, quiet))
    assert judge.fate(of.path.read_text(), ()).survives
    assert judge.needs(of.path.read_text(), "carrier_base.drive")


def test_names_with_two_hyphens_are_no_end_of_a_comment(fleet: Path) -> None:
    path = subject(fleet).path
    path.write_text(path.read_text().replace("scout looks", "the eyes --> of it"))
    answer = repaired(Subject.read(path, pytest.fail), "carrier_base.turn")
    assert answer.repair is not None
    assert "'the eyes - -> of it'" in answer.repair.text
