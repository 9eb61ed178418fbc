"""Branches and whole missions made of what skills are for: roles, what they need, what they achieve."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from repair_rovers import ERRAND, LOOP, MODELS, ROUNDS, rover
from repair_worlds import GOOD

from alula.common.faults import FaultRequest
from alula.language.models import ModelFile, check_texts
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import MockedMission
from alula.missions.part import NO_PART
from alula.mock import load_behaviour
from alula.model.expressions import Comparison, DataIs, ResourceIs
from alula.prove.limits import Deadline
from alula.repair.courses import Courses, Here, initial_states
from alula.repair.errors import RepairError
from alula.repair.judging import Judge
from alula.repair.planning import Aim, Planner
from alula.repair.planning import Answer as Planned
from alula.repair.purposes import Purposes
from alula.repair.rendering import as_dict, as_text
from alula.repair.repairing import Answer, Question, Search
from alula.repair.subject import Subject

TIME_S = 600.0
"""What a search may take: it ends by its result, also on a busy machine."""
SKILLSETS = check_texts([ModelFile("rover.skill", MODELS)])[0].skillsets
BROUGHT = {
    "base.dock": [("base.place", "DOCKED"), ("power.charger", "ON")],
    "base.drive": [("base.place", "AWAY"), ("power.charger", "OFF")],
}


def quiet(_line: str) -> None:
    """Take no notice."""


# --- courses ------------------------------------------------------------------------------------------------------------


def course(states: dict[str, str], *wanted: tuple[str, ResourceIs | DataIs], using: tuple[str, ...] = ()) -> list[str] | None:
    """Return the shortest course from power-up, but for ``states``, to what is wanted."""
    courses = Courses(Purposes(SKILLSETS, BROUGHT), using)
    start = initial_states(SKILLSETS, []) | states
    found = courses.to(Here(start), lambda one: all(map(one.heres[-1].fulfils, wanted)))
    return next(([step.name for step in one.steps] for one in found), None)


DOCKED = "", ResourceIs("base.place", "DOCKED")
AWAY = {"base.place": "AWAY"}


def test_a_course_brings_about_what_its_skills_need() -> None:
    (enough,) = [one.condition for one in SKILLSETS[2].skill("supply").preconditions]
    assert course(AWAY, DOCKED) == ["base.dock"]
    assert course({**AWAY, "base.pose": "LOST"}, DOCKED) == ["base.turn", "base.dock"]
    assert course({**AWAY, "base.pose": "LOST"}, ("power", enough)) == ["base.turn", "base.dock", "power.charge"]
    assert course({"power.charger": "ON"}, ("power", enough)) == ["power.charge"]


def test_a_course_has_only_skills_whose_needs_can_be_filled() -> None:
    assert course({**AWAY, "eyes.laser": "BROKEN"}, DOCKED) is None
    assert course(AWAY, DOCKED, using=("base.turn",)) is None
    assert course({"eyes.laser": "BROKEN"}, ("", ResourceIs("base.place", "AWAY"))) is None  # by its mock only driving leads away


def test_a_threshold_is_reached_by_one_that_is_further_away() -> None:
    data = ("battery", ("percentage",))
    kinds = [one.achieves for one in SKILLSETS[2].skills if isinstance(one.achieves, DataIs)]
    assert [(one.data, one.path) for one in kinds] == [data]
    plugged = {"power.charger": "ON"}
    for value, reached in ((0.1, True), (0.6, True), (0.7, False)):
        asked = DataIs(*data, Comparison.GT, value)
        assert (course(plugged, ("power", asked)) is not None) == reached, value
    assert course(plugged, ("power", DataIs(*data, Comparison.LT, 0.7))) is None


# --- repairs ------------------------------------------------------------------------------------------------------------


def repaired(mission: str, fault: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Subject, Answer]:
    monkeypatch.setenv("ALULA_ROBOT", str(folder))
    subject = Subject.read(rover(folder, mission), quiet)
    return subject, Search(subject, Question(fault), Deadline.after(TIME_S), quiet).run()


def skills_in(xml: str) -> list[str]:
    return re.findall(r"<(\w+\.\w+) ", xml)


def fly(subject: Subject, text: str, fault: str) -> list[list[str]]:
    """Fly a mission's text over the robot's mocks with a fault from each moment on; return the skills that ran each time."""
    path = subject.path.with_name("flown.xml")
    path.write_text(text)
    behaviour = load_behaviour([subject.path.parents[1] / "skillsets/mock.yaml"], subject.skillsets)

    def flown(*faults: FaultRequest) -> MockedMission:
        plan = plan_of_file(path, "main", subject.skillsets, {}, NO_PART)
        mission = MockedMission(subject.skillsets, behaviour, plan, faults=faults, limit_s=300.0)
        assert mission.run().outcome in GOOD, faults
        return mission

    moments = sorted({one.stamp_ns for one in flown().events if one.stamp_ns > 0})
    runs = [flown(FaultRequest(fault, begin_s=at_ns / 1e9 + 0.001)) for at_ns in moments]
    return [[f"{one.skillset}.{one.skill}" for one in mission.ended] for mission in runs]


def test_another_skill_of_its_role_goes_on_with_what_that_one_needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    subject, answer = repaired(ERRAND.replace("PORTS", ""), "laser", tmp_path, monkeypatch)
    assert answer.repair is not None
    xml = answer.repair.branch.as_xml()
    assert skills_in(xml) == ["eyes.feel", "base.creep"]
    assert 'to="{goal}"' in xml
    assert answer.repair.branch.size <= 15
    assert any("base.creep" in run for run in fly(subject, answer.repair.text, "laser"))


GRIPPER = """
skillset gripper {
  resource jaws { initial OPEN  OPEN -> CLOSED  CLOSED -> OPEN }
  skill grasp { effect { shut: jaws -> CLOSED }  precondition { open: resource = (jaws == OPEN) }
    result { success HELD: apply = shut  failure MISSED } }
}
"""


def test_what_is_done_and_can_not_be_started_again_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The laser may be lost when the thing is held already: a branch that grasps it once more is refused."""
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    drive = '<base.drive name="drive" to="{goal}"/>'
    path = rover(tmp_path, ERRAND.replace(drive, f'{drive}<gripper.grasp name="take it"/>'))
    models, mocks = (path.parents[1] / "skillsets" / name for name in ("rover.skill", "mock.yaml"))
    models.write_text(MODELS.replace("touch", "sight") + GRIPPER)
    mocks.write_text(mocks.read_text().replace("faults:", "  gripper.grasp: {delay: 1, result: HELD}\nfaults:", 1))
    subject = Subject.read(path, quiet)
    told: list[str] = []
    answer = Search(subject, Question("laser", others=False), Deadline.after(TIME_S), told.append).run()
    assert answer.repair is not None
    xml = answer.repair.branch.as_xml()
    assert skills_in(xml) == ["eyes.feel", "base.drive", "gripper.grasp"]
    assert '<ScriptCondition name="done already" code="gripper.jaws == CLOSED"/>' in xml
    assert any("gripper.grasp is refused then (open)" in line for line in told)
    runs = fly(subject, answer.repair.text, "laser")
    assert any("gripper.grasp" in run[: run.index("eyes.feel")] for run in runs if "eyes.feel" in run)


def test_a_fault_is_survived_under_the_assumption_that_nothing_comes_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dust leaves the bumper alone at first: with it the rover goes on, until that is stuck, too; then the mission is given up at rest."""
    subject, answer = repaired(ERRAND.replace("PORTS", ""), "dust", tmp_path, monkeypatch)
    assert answer.repair is not None
    assert skills_in(answer.repair.branch.as_xml()) == ["eyes.feel", "base.creep"]
    assert answer.assuming == ("eyes.bumper STUCK",)
    (fate,) = [one for faults, one in answer.repair.after.items() if faults == ("dust",)]
    assert (fate.survives, fate.assuming, fate.safe) == (False, answer.assuming, True)
    assert as_dict(answer, None)["assuming"] == ["eyes.bumper STUCK"]
    assert "survives assuming that eyes.bumper does not become STUCK later" in as_text(answer, None)
    subject.path.write_text(answer.repair.text)
    again = Search(Subject.read(subject.path, quiet), Question("dust"), Deadline.after(TIME_S), quiet).run()
    assert (again.survives_already, again.assuming) == (True, answer.assuming)


def test_an_assumption_is_what_makes_a_mission_survive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing is said to come later, the same mission survives; where the later state matters to nothing, nothing is assumed."""
    subject, answer = repaired(ERRAND.replace("PORTS", ""), "laser", tmp_path, monkeypatch)
    assert answer.repair is not None
    file = tmp_path / "skillsets/faults.yaml"
    whole = file.read_text()
    found = []
    for later in ("later: {eyes.bumper: STUCK}", "later: {base.pose: LOST}", "later: {}"):
        file.write_text(whole.replace("later: {eyes.bumper: STUCK}", later))
        fate = Judge(Subject.read(subject.path, quiet), Deadline.after(TIME_S)).fate(answer.repair.text, ["dust"])
        found.append((fate.survives, fate.assuming))
    assert found == [(False, ("eyes.bumper STUCK",)), (True, ()), (True, ())]


def test_where_nothing_goes_on_it_ends_at_the_place_that_the_mission_calls_safe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Driving is done by two legs, so that no other way is in reach of one branch; the safe place is."""
    two = ERRAND.replace('<base.drive name="drive" to="{goal}"/>', '<base.drive name="a" to="{goal}"/><base.drive name="b" to="{goal}"/>')
    subject, answer = repaired(two.replace("PORTS", '<input_port name="safe" default="2"/>'), "laser", tmp_path, monkeypatch)
    assert answer.repair is not None
    xml = answer.repair.branch.as_xml()
    assert skills_in(xml) == ["eyes.feel", "base.creep"]
    assert 'to="{safe}"' in xml
    assert any("base.creep" in run for run in fly(subject, answer.repair.text, "laser"))


def test_what_a_skill_needs_is_brought_about_before_it_has_another_chance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    subject, answer = repaired(ROUNDS, "battery", tmp_path, monkeypatch)
    assert answer.repair is not None
    assert answer.repair.branch.size <= 15
    again = [one.get("num_attempts") or one.get("attempts") for one in answer.repair.branch.use.iterate() if "Retry" in one.tag]
    assert again == ["3"]
    xml = answer.repair.branch.as_xml()
    assert skills_in(xml) == ["eyes.scan", "base.dock", "power.charge"]
    assert '<Awaits name="the charger is on" if="power.charger == ON" within="5"/>' in xml
    runs = fly(subject, answer.repair.text, "battery")
    assert any("power.charge" in run for run in runs)


def test_a_loop_that_goes_on_needs_no_other_chances(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Behind the node that failed, for its failure alone: the loop ticks it again when the skills have brought about what it needs."""
    subject, answer = repaired(LOOP, "battery", tmp_path, monkeypatch)
    assert answer.repair is not None
    branch = answer.repair.branch
    assert (branch.around, branch.wraps) == (False, False)
    assert branch.tree is not None
    assert branch.tree.children[0].get("code") == "supplied == 'EMPTY'"  # the dock itself asks for the pose
    assert skills_in(branch.as_xml()) == ["eyes.scan", "base.dock", "power.charge"]
    assert any("power.charge" in run for run in fly(subject, answer.repair.text, "battery"))
    assert any(run.count("base.drive") > 1 for run in fly(subject, answer.repair.text, "battery"))


def test_a_fault_refuses_requests_no_more_often_than_it_ends_skills(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A battery that is low ends the supply, or has it refused, by the same condition: charged as often as that, it is survived."""
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    path = rover(tmp_path, ROUNDS)
    faults = path.parents[1] / "skillsets/faults.yaml"
    faults.write_text(faults.read_text().replace("power.supply: EMPTY", "power.supply: [EMPTY, enough]"))
    subject = Subject.read(path, quiet)
    found = []
    for strikes in (1, 2):
        answer = Search(subject, Question("battery", most_faults=strikes, others=False), Deadline.after(TIME_S), quiet).run()
        assert answer.repair is not None
        fates = [
            Judge(subject, Deadline.after(TIME_S), strikes=more).fate(answer.repair.text, ["battery"]) for more in (strikes, strikes + 1)
        ]
        found.append([fate.survives for fate in fates])
    assert found == [[True, False]] * 2


def test_what_nobody_knows_and_the_mission_hangs_on_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where an input may be 0, the drive may have no chance at all, and no branch for a fault mends that."""
    drive = '<base.drive name="drive" to="{goal}"/>'
    text = ERRAND.replace(drive, f'<RetryUntilSuccessful name="try" num_attempts="{{tries}}">{drive}</RetryUntilSuccessful>')
    _, answer = repaired(text.replace("PORTS", '<input_port name="tries"/>'), "person", tmp_path, monkeypatch)
    assert answer.repair is None
    assert answer.reasons[0].startswith("the mission may not be accomplished though nothing fails; it may be that `tries` is not > 0")


MENDED = """
<Sequence name="mend">
  <ScriptCondition name="not too often" code="mended &lt; MOST"/>
  <Script name="count" code="mended += 1"/>
  <base.dock name="dock"/>
  <Awaits name="the charger is on" if="power.charger == ON" within="5"/>
  <power.charge name="charge"/>
</Sequence>"""


@pytest.mark.parametrize("most", [1, 2, 5])
def test_a_mission_that_counts_its_answers_survives_as_many_strikes(most: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A count that a script keeps is the number that it is, not any one below the last that is allowed."""
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    text = LOOP.replace('<AlwaysFailure name="nothing mends it"/>', MENDED.replace("MOST", str(most)))
    text = text.replace("done := 0;", "done := 0; mended := 0;")
    subject = Subject.read(rover(tmp_path, text), quiet)
    survived = [Judge(subject, Deadline.after(TIME_S), strikes=strikes).fate(text, ["battery"]).survives for strikes in range(1, 5)]
    assert survived == [strikes <= most for strikes in range(1, 5)]
    assert any("power.charge" in run for run in fly(subject, text, "battery"))
    answer = Search(subject, Question("battery", most_faults=1), Deadline.after(TIME_S), quiet).run()
    assert as_text(answer, None).endswith("survives it, as often as it may come (`--most-faults 1`)\n")


# --- plans --------------------------------------------------------------------------------------------------------------


def planned(aim: Aim, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Planned:
    monkeypatch.setenv("ALULA_ROBOT", str(folder))
    rover(folder, ROUNDS)
    return Planner(aim, Deadline.after(TIME_S), quiet).run()


def test_a_role_is_planned_from_nothing_with_its_other_ways(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = planned(Aim("arrival"), tmp_path, monkeypatch).plan
    assert plan is not None
    assert plan.steps == ("base.drive",)
    assert sorted(skills_in(plan.text)) == ["base.creep", "base.drive", "eyes.feel", "eyes.scan"]
    assert plan.nodes <= 15
    assert {name for name, fate in plan.fates.items() if fate.survives} >= {"laser", "person"}
    path = tmp_path / "missions/planned.xml"
    path.write_text(plan.text.replace('<input_port name="to"/>', '<input_port name="to" default="1"/>'))
    subject = Subject.read(path, quiet)
    assert any("base.creep" in run for run in fly(subject, path.read_text(), "laser"))
    assert any(run.count("base.drive") > 1 for run in fly(subject, path.read_text(), "person"))


def test_a_state_is_planned_from_another_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    aim = Aim("base.place == DOCKED", "base.place == AWAY and base.pose == LOST")
    plan = planned(aim, tmp_path, monkeypatch).plan
    assert plan is not None
    assert plan.steps == ("base.turn", "base.dock")
    assert '<Awaits name="the pose is good" if="base.pose == GOOD" within="5"/>' in plan.text
    assert re.findall(r'<Needs name="(.*?)"', plan.text) == ["the laser is OK"]  # what no skill of it brings about


def test_parts_of_a_goal_are_reached_one_after_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps that need the same share what fills it; a skill that comes again has inputs of its own."""
    plan = planned(Aim("arrival then arrival then base.place == DOCKED"), tmp_path, monkeypatch).plan
    assert plan is not None
    assert plan.steps == ("base.drive", "base.drive", "base.dock")
    work = plan.text.partition("<BehaviorTree ID=")[2].partition("</BehaviorTree>")[0]
    assert skills_in(work)[:2] == ["eyes.scan", "base.dock"]
    uses = [' ID="drive" name="drive" to="{to}"/>', ' ID="drive" name="drive 2" to="{to_2}"/>']
    assert re.findall(r"<SubTree( .* to=.*)", work) == uses
    assert re.search(r'<Awaits name=".*" if="base.place == DOCKED" within="5"/>', work)
    assert plan.nodes <= 15
    path = tmp_path / "missions/planned.xml"
    path.write_text(re.sub(r'(<input_port name="to(?:_2)?")/>', r'\1 default="1"/>', plan.text))
    assert all("base.dock" in run for run in fly(Subject.read(path, quiet), path.read_text(), "person"))


def test_a_part_of_a_goal_that_is_so_already_takes_no_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = planned(Aim("base.place == DOCKED then arrival then base.place == AWAY", "base.place == AWAY"), tmp_path, monkeypatch).plan
    assert plan is not None
    assert plan.steps == ("base.dock", "base.drive")


BOX = """
skillset cargo {
  resource box { initial EMPTY  EMPTY -> FULL  FULL -> EMPTY }
  skill load {
    effect { full: box -> FULL }  precondition { room: resource = (box == EMPTY) }  result { success LOADED: apply = full } }
  skill unload {
    effect { empty: box -> EMPTY }  precondition { full: resource = (box == FULL) }  result { success UNLOADED: apply = empty } }
}
"""


@pytest.mark.parametrize(
    ("goal", "steps", "accepted"),
    [
        ("cargo.box == FULL", ("cargo.load",), ["cargo.box == FULL"]),
        ("cargo.box == FULL then arrival then cargo.box == EMPTY", ("cargo.load", "base.drive", "cargo.unload"), ["cargo.box == FULL"]),
    ],
)
def test_a_state_that_the_goal_asks_for_may_be_left(
    goal: str, steps: tuple[str, ...], accepted: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing can be loaded any more once the box is full; and the robot departs with a skillset that such a mission may not use."""
    folder = rover(tmp_path, ROUNDS).parents[1]
    (folder / "skillsets/box.skill").write_text(BOX)
    (folder / "robot.yaml").write_text("name: rover\ndeparture: base.place DOCKED\nrest: base.wheels FREE\n")
    monkeypatch.setenv("ALULA_ROBOT", str(folder))
    plan = Planner(Aim(goal, most_faults=1), Deadline.after(TIME_S), quiet).run().plan
    assert plan is not None
    assert plan.steps == steps
    assert re.findall(r"accepted ALU701 \((.*?)\): the goal asks for it", plan.text) == accepted


def test_what_no_skill_leads_to_is_impossible(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = planned(Aim("eyes.laser == OK", "eyes.laser == BROKEN"), tmp_path, monkeypatch)
    assert (answer.plan, answer.impossible, answer.tried) == (None, True, 0)
    assert "base.drive can't start at first: sight" in answer.reasons


@pytest.mark.parametrize(
    ("aim", "message"),
    [
        (Aim("base.place == HOME"), "--goal 'base.place == HOME': base.place has no state HOME; it has DOCKED, AWAY"),
        (Aim("base.plaice == DOCKED"), "--goal 'base.plaice == DOCKED': there is no resource base.plaice"),
        (Aim("base.dock running"), "only states can be asked here"),
        (Aim("base.place == DOCKED"), "it is so at first; say what is so by --from"),
        (Aim("base.place =="), "--goal 'base.place ==': can't be read as a condition"),
        (Aim("arrival", "not base.place == AWAY"), "--from 'not base.place == AWAY': write states"),
        (Aim("arrival", using=("base.fly",)), "--using base.fly: there is no such skill"),
        (Aim("sight"), "--goal 'sight'"),
        (Aim("arrival then sight"), "--goal 'sight': no skill fills this role by its success; there are arrival"),
        (Aim("arrival then"), "--goal '': can't be read as a condition"),
    ],
)
def test_what_can_not_be_planned_is_one_line(aim: Aim, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RepairError) as caught:
        planned(aim, tmp_path, monkeypatch)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
