"""Branches and whole missions made of what skills are for: roles, what they need, what they achieve."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from repair_rovers import ERRAND, MODELS, ROUNDS, rover
from repair_worlds import GOOD

from alula.common.faults import FaultRequest
from alula.language.models import ModelFile, check_texts
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import MockedMission
from alula.missions.part import NO_PART
from alula.mock import load_behaviour
from alula.model.expressions import Comparison, DataIs, ResourceIs
from alula.prove.limits import Deadline
from alula.repair.courses import Courses, initial_states
from alula.repair.errors import RepairError
from alula.repair.judging import Judge
from alula.repair.planning import Aim, Planner
from alula.repair.planning import Answer as Planned
from alula.repair.purposes import Purposes
from alula.repair.repairing import Answer, Question, Search
from alula.repair.subject import Subject
from alula.repair.telling import as_dict, as_text

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
    found = courses.to(start, lambda one: all(map(one.heres[-1].fulfils, wanted)))
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


def test_what_no_skill_leads_to_is_impossible(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = planned(Aim("eyes.laser == OK", "eyes.laser == BROKEN"), tmp_path, monkeypatch)
    assert (answer.plan, answer.impossible, answer.tried) == (None, True, 0)
    assert "base.drive can't start at first: sight" in answer.reasons


@pytest.mark.parametrize(
    ("aim", "message"),
    [
        (Aim("base.place == HOME"), "--goal 'base.place == HOME': base.place has no state HOME; it has DOCKED, AWAY"),
        (Aim("base.plaice == DOCKED"), "--goal 'base.plaice == DOCKED': there is no resource base.plaice"),
        (Aim("running(base.dock)"), "only states can be asked here"),
        (Aim("base.place == DOCKED"), "it is so at first; say what is so by --from"),
        (Aim("base.place =="), "--goal 'base.place ==': can't be read as a condition"),
        (Aim("arrival", "not base.place == AWAY"), "--from 'not base.place == AWAY': write states"),
        (Aim("arrival", using=("base.fly",)), "--using base.fly: there is no such skill"),
        (Aim("sight"), "--goal 'sight'"),
    ],
)
def test_what_can_not_be_planned_is_one_line(aim: Aim, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RepairError) as caught:
        planned(aim, tmp_path, monkeypatch)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
