"""Two missions after foreign ones whose recovery is deleted: a robot that follows a path among obstacles, and a guide of visitors.

The first is after the tree by which Nav2 replans and recovers: what is in its way is cleared out of the map, or it backs up. The second is
after a museum's guide: visitors who lag behind are called, and a low battery is charged.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from repair_worlds import GOOD

from alula.common.faults import FaultRequest
from alula.missions.director import Outcome
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import MockedMission
from alula.missions.part import NO_PART
from alula.mock import load_behaviour
from alula.prove.limits import Deadline
from alula.repair.judging import Judge
from alula.repair.repairing import Answer, Question, Search
from alula.repair.subject import Subject

TIME_S = 600.0
"""What a search may take: it ends by its result, also on a busy machine."""
MOST_NODES = 15

NAVIGATOR = {
    "robot.yaml": "name: navigator\nrest: nav.wheels FREE\n",
    "skillsets/navigator.skill": """
skillset nav {
  resource wheels { initial FREE  FREE -> USED  USED -> FREE }
  resource costmap { initial CLEAR  extern CLEAR -> CLUTTERED  extern CLUTTERED -> CLEAR }
  resource front { initial OPEN  extern OPEN -> BLOCKED  extern BLOCKED -> OPEN }
  skill compute_path { input { goal: int32 }
    precondition { clear: resource = (costmap == CLEAR) }  invariant { clear: resource = (costmap == CLEAR) }
    result { success FOUND  failure NO_PATH } }
  skill follow_path { effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  clear: resource = (costmap == CLEAR)
      open: resource = (front == OPEN)  success take }
    invariant { clear: resource = (costmap == CLEAR) violation = give  open: resource = (front == OPEN) violation = give }
    interrupt { apply = give }  result { success THERE: apply = give  failure STUCK: apply = give } }
  skill clear_costmap { achieves resource = (costmap == CLEAR)  result { success CLEARED } }
  skill back_up { achieves resource = (front == OPEN)  effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  success take }
    interrupt { apply = give }  result { success FREED: apply = give  failure STUCK: apply = give } }
  skill spin { effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  success take }
    interrupt { apply = give }  result { success TURNED: apply = give  failure STUCK: apply = give } }
  skill wait { result { success WAITED } }
}
""",
    "skillsets/mock.yaml": """
skills:
  nav.compute_path: {delay: 1, result: FOUND}
  nav.clear_costmap: {delay: 1, result: CLEARED, then: [{after: 0.5, set: {nav.costmap: CLEAR}}]}
  nav.follow_path: {delay: 4, result: THERE}
  nav.back_up: {delay: 2, result: FREED, then: [{after: 1.5, set: {nav.front: OPEN}}]}
faults:
  clutter: {set: {}, then: [{after: 0, set: {nav.costmap: CLUTTERED}}]}
  blocked: {set: {}, then: [{after: 0, set: {nav.front: BLOCKED}}]}
""",
    "skillsets/faults.yaml": """
faults:
  clutter: {states: {nav.costmap: CLUTTERED}}
  blocked: {states: {nav.front: BLOCKED}}
""",
    "missions/main.xml": """<root BTCPP_format="4" main_tree_to_execute="navigate">
  <BehaviorTree ID="navigate">
    <Fallback name="navigate">
      <Sequence name="along a path">
        <nav.compute_path name="compute the path" goal="1"/>
        <nav.follow_path name="follow it"/>
      </Sequence>
      <AlwaysFailure name="given up"/>
    </Fallback>
  </BehaviorTree>
</root>
""",
}
GUIDE = {
    "robot.yaml": "name: guide\nrest: guide.wheels FREE\n",
    "skillsets/guide.skill": """
skillset guide {
  resource wheels { initial FREE  FREE -> USED  USED -> FREE }
  resource visitors { initial FOLLOWING  extern FOLLOWING -> LAGGING  extern LAGGING -> FOLLOWING }
  resource place { initial AWAY  extern AWAY -> CHARGER  extern CHARGER -> AWAY }
  resource battery { initial GOOD  extern GOOD -> LOW  extern LOW -> GOOD }
  skill lead { input { exhibit: int32 }  effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  here: resource = (visitors == FOLLOWING)
      enough: resource = (battery == GOOD)  success take }
    invariant { here: resource = (visitors == FOLLOWING) violation = give  enough: resource = (battery == GOOD) violation = give }
    interrupt { apply = give }  result { success THERE: apply = give  failure STUCK: apply = give } }
  skill explain { input { exhibit: int32 }
    precondition { here: resource = (visitors == FOLLOWING) }  invariant { here: resource = (visitors == FOLLOWING) }
    result { success TOLD } }
  skill turn_and_call { achieves resource = (visitors == FOLLOWING)  effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  success take }
    interrupt { apply = give }  result { success CALLED: apply = give  failure NOBODY: apply = give } }
  skill go_to_charger { achieves resource = (place == CHARGER)  effect { take: wheels -> USED  give: wheels -> FREE }
    precondition { free: resource = (wheels == FREE)  success take }
    interrupt { apply = give }  result { success THERE: apply = give  failure STUCK: apply = give } }
  skill charge { achieves resource = (battery == GOOD)
    precondition { plugged: resource = (place == CHARGER) }  invariant { plugged: resource = (place == CHARGER) }
    result { success FULL  failure NO_CURRENT } }
}
""",
    "skillsets/mock.yaml": """
skills:
  guide.explain: {delay: 3, result: TOLD}
  guide.turn_and_call: {delay: 2, result: CALLED, then: [{after: 1.5, set: {guide.visitors: FOLLOWING}}]}
  guide.lead: {delay: 4, result: THERE, then: [{after: 0.5, set: {guide.place: AWAY}}]}
  guide.go_to_charger: {delay: 3, result: THERE, then: [{after: 2.5, set: {guide.place: CHARGER}}]}
  guide.charge: {delay: 5, result: FULL, then: [{after: 4.5, set: {guide.battery: GOOD}}]}
faults:
  lagging: {set: {}, then: [{after: 0, set: {guide.visitors: LAGGING}}]}
  battery: {set: {}, then: [{after: 0, set: {guide.battery: LOW}}]}
""",
    "skillsets/faults.yaml": """
faults:
  lagging: {states: {guide.visitors: LAGGING}}
  battery: {states: {guide.battery: LOW}}
""",
    "missions/main.xml": """<root BTCPP_format="4" main_tree_to_execute="tour">
  <BehaviorTree ID="tour">
    <Fallback name="tour">
      <Sequence name="to the exhibit, and tell of it">
        <guide.lead name="lead the visitors" exhibit="1"/>
        <guide.explain name="explain the exhibit" exhibit="1"/>
      </Sequence>
      <AlwaysFailure name="given up"/>
    </Fallback>
  </BehaviorTree>
</root>
""",
}


def quiet(_line: str) -> None:
    """Take no notice."""


def repaired(files: dict[str, str], fault: str, strikes: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Subject, Answer]:
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    monkeypatch.setenv("ALULA_ROBOT", str(folder))
    subject = Subject.read(folder / "missions/main.xml", pytest.fail)
    return subject, Search(subject, Question(fault, most_faults=strikes), Deadline.after(TIME_S, quiet), quiet).run()


def skills_in(xml: str) -> list[str]:
    return re.findall(r"<(\w+\.\w+) ", xml)


def fly(subject: Subject, text: str, fault: str, strikes: int) -> list[list[str]]:
    """Fly a mission's text over the robot's mocks; return the skills that ran each time.

    The fault comes at each moment at which something has happened when it had not come, and ``strikes`` times in all where what it stopped
    runs again: each time at the moment at which something has happened since.
    """
    path = subject.path.with_name("flown.xml")
    path.write_text(text)
    behaviour = load_behaviour([subject.path.parents[1] / "skillsets/mock.yaml"], subject.skillsets)

    def flown(*at_s: float) -> MockedMission:
        plan = plan_of_file(path, "main", subject.skillsets, {}, NO_PART)
        faults = [FaultRequest(fault, begin_s=one) for one in at_s]
        mission = MockedMission(subject.skillsets, behaviour, plan, faults=faults, limit_s=300.0)
        assert mission.run().outcome in GOOD, at_s
        return mission

    def moments(mission: MockedMission, from_s: float) -> list[float]:
        found = sorted({one.stamp_ns for one in mission.events if one.stamp_ns / 1e9 > from_s})
        return [at_ns / 1e9 + 0.001 for at_ns in found]

    runs = [((), flown())]
    for _ in range(strikes):
        runs = [((*at_s, one), flown(*at_s, one)) for at_s, mission in runs for one in moments(mission, at_s[-1] if at_s else 0.0)]
    return [[f"{one.skillset}.{one.skill}" for one in mission.ended] for _, mission in runs]


CALLED = ["guide.turn_and_call"]
CHARGED = ["guide.go_to_charger", "guide.charge"]


@pytest.mark.parametrize("strikes", [1, 2])
@pytest.mark.parametrize(
    ("files", "fault", "skills", "tried"),
    [
        (NAVIGATOR, "clutter", ["nav.clear_costmap"], ["nav.compute_path", "nav.follow_path"]),
        (NAVIGATOR, "blocked", ["nav.back_up"], ["nav.follow_path"]),
        (GUIDE, "lagging", CALLED, ["guide.lead", "guide.explain"]),
        (GUIDE, "battery", CHARGED, ["guide.lead"]),
    ],
    ids=["clutter", "blocked", "lagging", "battery"],
)
def test_a_recovery_that_was_deleted_is_written_again(
    files: dict[str, str],
    fault: str,
    skills: list[str],
    tried: list[str],
    strikes: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What takes the fault away is done as often as that comes, then what failed is tried again; no other skill is in it."""
    subject, answer = repaired(files, fault, strikes, tmp_path, monkeypatch)
    assert answer.repair is not None
    branch = answer.repair.branch
    assert (branch.size <= MOST_NODES, skills_in(branch.as_xml())) == (True, skills)
    (retried,) = re.findall(r"<Retry.*?</Retry", answer.repair.text, re.DOTALL)
    assert skills_in(retried) == tried
    fates = [Judge(subject, Deadline.after(TIME_S), strikes=more).fate(answer.repair.text, [fault]) for more in (1, 2)]
    assert [(fate.survives, fate.safe) for fate in fates] == [(True, True), (strikes == 2, True)]
    runs = fly(subject, answer.repair.text, fault, strikes)
    mended = [run for run in runs if set(skills) <= set(run)]
    assert mended
    assert all(run[-1] in {"nav.follow_path", "guide.explain"} for run in runs)
    assert max(run.count(skills[-1]) for run in mended) == strikes


@pytest.mark.parametrize(("called", "outcome"), [("CALLED", Outcome.DEGRADED), ("NOBODY", Outcome.ACCOMPLISHED)])
def test_a_mission_is_degraded_only_where_the_recovery_has_succeeded(
    called: str, outcome: Outcome, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where it fails, but the visitors come again by themselves, the tour is the one that was planned."""
    subject, answer = repaired(GUIDE, "lagging", 1, tmp_path, monkeypatch)
    assert answer.repair is not None
    path, mocks = subject.path.with_name("flown.xml"), tmp_path / "skillsets/mock.yaml"
    path.write_text(answer.repair.text)
    mocks.write_text(mocks.read_text().replace("result: CALLED", f"result: {called}"))
    plan = plan_of_file(path, "main", subject.skillsets, {}, NO_PART)
    faults = [FaultRequest("lagging", begin_s=1.0)]
    mission = MockedMission(subject.skillsets, load_behaviour([mocks], subject.skillsets), plan, faults=faults, limit_s=300.0)
    assert mission.run().outcome == outcome
    assert "guide.turn_and_call" in [f"{one.skillset}.{one.skill}" for one in mission.ended]
