"""An inspection robot that nobody has repaired before: two cameras, an arm that stays where it was brought, a bumper."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from alula.prove.limits import Deadline
from alula.repair.repairing import Answer, Question, Search
from alula.repair.subject import Subject

MODELS = """
skillset look {
  resource camera { initial UNKNOWN  extern UNKNOWN -> OK  extern OK -> DARK  extern DARK -> OK }
  resource thermal { initial UNKNOWN  extern UNKNOWN -> OK  extern OK -> HOT  extern HOT -> OK }
  resource arm { initial STOWED  STOWED -> MOVING  MOVING -> STOWED  MOVING -> OUT  OUT -> MOVING }
  skill watch { provides view  progress = 0.5
    precondition { works: resource = (camera == OK) }  invariant { works: resource = (camera == OK) }  result { failure FROZEN } }
  skill watch_warm { provides view  progress = 0.5
    precondition { warm: resource = (thermal == OK) }  invariant { warm: resource = (thermal == OK) }  result { failure FROZEN } }
  skill reach { effect { go: arm -> MOVING  there: arm -> OUT  back: arm -> STOWED }
    precondition { in: resource = (arm == STOWED)  success go }  interrupt { apply = back }
    result { success OUT: apply = there  failure STUCK: apply = back } }
  skill stow { effect { go: arm -> MOVING  there: arm -> STOWED  stay: arm -> OUT }
    precondition { out: resource = (arm == OUT)  success go }  interrupt { apply = stay }
    result { success STOWED: apply = there  failure STUCK: apply = stay } }
  skill inspect { needs view  input { point: int32 }
    precondition { out: resource = (arm == OUT) }  invariant { out: resource = (arm == OUT) }  result { success SEEN  failure BLURRED } }
}
skillset base {
  resource wheels { initial FREE  FREE -> USED  USED -> FREE }
  resource bumper { initial CLEAR  extern CLEAR -> PRESSED  extern PRESSED -> CLEAR }
  skill drive { effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  clear: resource = (bumper == CLEAR)  success take }
    invariant { clear: resource = (bumper == CLEAR) violation = give }
    interrupt { apply = give }  result { success THERE: apply = give  failure STUCK: apply = give } }
  skill back_off { achieves resource = (bumper == CLEAR)  INPUT effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  success take }
    interrupt { apply = give }  result { success FREED: apply = give  failure STUCK: apply = give } }
}
"""
FAULTS = """
faults:
  camera: {states: {look.camera: DARK}}
  blur: {ends: {look.inspect: BLURRED}}
  obstacle: {states: {base.bumper: PRESSED}}
"""
MISSION = """<root BTCPP_format="4" main_tree_to_execute="inspect">
  <BehaviorTree ID="inspect">
    <Fallback name="inspect">
      <Sequence name="there and back">
        <base.drive name="drive"/>
        <look.reach name="reach out"/>
        <Parallel name="look at it" success_count="1" failure_count="1">
          <look.watch name="watch"/>
          <look.inspect name="inspect the weld" point="1"/>
        </Parallel>
        <look.stow name="stow"/>
      </Sequence>
      <AlwaysFailure name="given up"/>
    </Fallback>
  </BehaviorTree>
  <BehaviorTree ID="ready">
    <Needs name="its eyes" if="READY" otherwise="'no eyes'"/>
  </BehaviorTree>
</root>
"""
READY = "look.camera == OK &amp;&amp; look.thermal == OK"
DISTANCE = "input { distance: float64 }"


def repaired(fault: str, folder: Path, monkeypatch: pytest.MonkeyPatch, ready: str = READY, given: str = "") -> tuple[Answer, list[str]]:
    mocks = "timeline:\n  - {after: 0.2, set: {look.camera: OK, look.thermal: OK}}\n"
    files = {
        "robot.yaml": "name: inspector\nrest: base.wheels FREE\n",
        "skillsets/inspector.skill": MODELS.replace("INPUT", given),
        "skillsets/faults.yaml": FAULTS,
        "skillsets/mock.yaml": mocks,
        "missions/inspect.xml": MISSION.replace("READY", ready),
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    monkeypatch.setenv("ALULA_ROBOT", str(folder))
    told: list[str] = []
    question = Question(fault, most_faults=1, others=False)
    search = Search(Subject.read(folder / "missions/inspect.xml", pytest.fail), question, Deadline.after(600.0, told.append), told.append)
    return search.run(), told


def test_another_camera_stands_for_the_one_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer, _ = repaired("camera", tmp_path, monkeypatch)
    assert answer.repair is not None
    assert "<look.watch_warm" in answer.repair.branch.as_xml()


def test_what_a_branch_needs_and_may_not_be_there_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer, told = repaired("camera", tmp_path, monkeypatch, ready="look.camera == OK")
    assert (answer.repair, answer.impossible, answer.reasons) == (None, False, ())
    assert any("no: with camera it may not be accomplished" in one and "look.thermal may be UNKNOWN then" in one for one in told)
    assert [f"{one.nodes} nodes, '{one.name}': no: {one.why}" for one in answer.refused] == [one for one in told if "': no: " in one]


def test_what_stays_where_it_was_brought_need_not_be_brought_there_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer, _ = repaired("blur", tmp_path, monkeypatch)
    assert answer.repair is not None
    assert answer.repair.branch.as_xml() == '<RetryUntilSuccessful name="two chances to inspect the weld" num_attempts="2"/>'


def test_a_fault_that_a_skill_takes_away_comes_as_often_as_faults_may(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It can't drive in the state that shows the fault, but back off."""
    answer, _ = repaired("obstacle", tmp_path, monkeypatch)
    assert answer.repair is not None
    assert answer.repair.branch.as_xml().startswith('<RetryUntilSuccessful name="two chances to drive" num_attempts="2">')
    assert "<base.back_off" in answer.repair.branch.as_xml()


def test_an_input_that_comes_from_nowhere_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer, _ = repaired("obstacle", tmp_path, monkeypatch, given=DISTANCE)
    assert (answer.repair, answer.impossible) == (None, False)
    assert answer.reasons == (
        "base.back_off would bring about what is needed, but nothing says what its input `distance` is; use it in a tree of the mission",
    )


def test_a_mission_that_may_fail_though_nothing_does_is_told_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer, _ = repaired("camera", tmp_path, monkeypatch, ready="look.arm == STOWED")
    assert answer.reasons[0].startswith("the mission may not be accomplished though nothing fails; ")
    assert "look.camera may be UNKNOWN then" in answer.reasons[0]
