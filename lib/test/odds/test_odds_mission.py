"""Missions of the drone's kind: timers, progress, nodes of its own, several faults; what is looked at first, and what that bounds."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import pytest
from tables import ACCOMPLISHED, GIVEN_UP, Table, chances, end, fault, now, storm

from alula.cli.odds import main
from alula.odds.figures import FaultFigures, Figures, SkillFigures, point
from alula.odds.graph import Graph, explore
from alula.odds.odds import odds_of
from alula.odds.process import quantify
from alula.odds.robot import mission_of
from alula.odds.storm import Storm
from alula.odds.system import Kind, Step

DRONE = Path(__file__).parents[3]

FLIGHT = {
    "begin": [end("fly", "DONE", "accomplished"), fault("motor", "limps")],
    "limps": [end("fly", "DONE", "accomplished"), fault("link", "given_up")],
}
FIGURES = Figures(
    {"motor": FaultFigures(rate=point("1/3600")), "link": FaultFigures(rate=point("1/36000"))}, {"fly": SkillFigures(lasts=point(60))}
)


def test_the_likeliest_situations_are_looked_at_and_the_rest_is_in_the_bounds() -> None:
    whole = chances(storm(FLIGHT, FIGURES))
    # The motor fails in 60 of 3600 flights: a search that leaves out what comes less often than one in ten does not look there.
    graph = explore(Table(FLIGHT), FIGURES, unlikely=0.1)
    assert graph.left == 1
    least, most = chances_of(graph)
    assert least == Fraction(60, 61)
    assert least < whole[0] == whole[1] < most == 1
    # And one that leaves out less than one in a thousand does, but not what the link would bring then, for it is 60 / 36000 of those.
    assert explore(Table(FLIGHT), FIGURES, unlikely=1e-3).left == 1
    assert explore(Table(FLIGHT), FIGURES, unlikely=1e-6).left == 0


def chances_of(graph: Graph) -> tuple[Fraction, Fraction]:
    asked = Storm(quantify(graph, FIGURES))
    return tuple(asked.chance([ACCOMPLISHED], most=most).number.low for most in (False, True))  # type: ignore[return-value]


def test_the_likeliest_are_looked_at_first() -> None:
    table = {
        "begin": [end("fly", "BLOCKED", "unlucky"), end("fly", "DONE", "well")],
        "unlucky": [now("given_up")],
        "well": [now("accomplished")],
    }
    figures = Figures(skills={"fly": SkillFigures(results={"DONE": point("0.9"), "BLOCKED": point("0.1")}, lasts=point(1))})
    asked = Storm(quantify(explore(Table(table), figures, most=3), figures))
    assert asked.chance([ACCOMPLISHED], most=False).number.low == Fraction(9, 10)


@pytest.mark.parametrize(
    ("step", "lasts_s"), [(Step(Kind.WAIT, "60 s", "given_up", seconds=60.0), 60), (Step(Kind.WAIT, "see", "given_up"), 30)]
)
def test_a_wait_races_with_what_it_waits_beside(step: Step[str], lasts_s: int) -> None:
    figures = Figures(skills={"fly": SkillFigures(lasts=point(60)), "see": SkillFigures(progress=point(30))})
    asked = storm({"begin": [end("fly", "DONE", "accomplished"), step]}, figures)
    assert chances(asked, GIVEN_UP) == (Fraction(60, 60 + lasts_s),) * 2


def test_without_a_figure_it_may_see_at_once_or_late_but_some_time() -> None:
    asked = storm(
        {"begin": [Step(Kind.WAIT, "see", "accomplished"), fault("motor", "given_up")]}, Figures({"motor": FaultFigures(rate=point(0))})
    )
    assert chances(asked) == (1, 1)


def test_what_flips_at_any_time_does_not_stop_the_time() -> None:
    """A sensor that flips between two states while a skill runs: the skill ends all the same."""
    table = {
        "begin": [end("fly", "DONE", "accomplished"), Step(Kind.ANY, "flips", "other")],
        "other": [end("fly", "DONE", "accomplished"), Step(Kind.ANY, "flips back", "begin"), fault("motor", "given_up")],
    }
    figures = Figures({"motor": FaultFigures(rate=point("1/60"))}, {"fly": SkillFigures(lasts=point(60))})
    found = odds_of(explore(Table(table), figures), figures, costs=False).outcomes
    least, most = found["accomplished"].least, found["accomplished"].most
    assert (least.low, most.low) == (Fraction(1, 2), 1)
    assert found["neither"].most.low == 0


def test_the_drone_has_useful_odds(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALULA_ROBOT", str(DRONE))
    assert main([str(DRONE / "missions/mapping.xml"), "--unlikely", "0.005", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    least, most = said["outcomes"]["accomplished"]["chance"]
    assert 0.9 < least < most < 1
    assert 0 < said["outcomes"]["given_up"]["chance"][0] < 0.05
    assert {cost["name"] for cost in said["costs"]} > {"zed", "pilot"}
    assert "encoder" not in {cost["name"] for cost in said["costs"]}  # no video there


FINDING = {
    "robot.yaml": "name: finder\n",
    "skillsets/finder.skill": """skillset finder {
  resource pose { initial UNKNOWN  extern UNKNOWN -> GOOD  extern GOOD -> LOST  extern LOST -> GOOD }
  skill find { result { success FOUND } }
}""",
    "skillsets/mock.yaml": """
skills: {finder.find: {delay: 8, result: FOUND, then: [{after: 7, set: {finder.pose: GOOD}}]}}
timeline: [{after: 1, set: {finder.pose: GOOD}}]
""",
    "missions/find.xml": """<root BTCPP_format="4" main_tree_to_execute="find">
  <BehaviorTree ID="find"><Sequence>
    <WaitFor name="it is lost" if="finder.pose == LOST"/>
    <WaitFor name="it is found" if="finder.pose == GOOD"/>
  </Sequence></BehaviorTree>
  <BehaviorTree ID="ready"><Needs name="knows" if="finder.pose == GOOD" otherwise="'it is lost'"/></BehaviorTree>
</root>""",
}


def test_what_a_skill_brings_about_comes_by_the_clock_before_the_mission_begins_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in FINDING.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    read, steps_of, _ = mission_of(tmp_path / "missions/find.xml")
    system = read("")
    steps = steps_of(system)
    seen = set(steps.initial())
    todo = list(seen)
    while todo:
        new = {step.target for step in steps.steps(todo.pop())} - seen
        seen |= new
        todo += new
    poses = {(system.started(one.state), steps.resource(one, "finder.pose")) for one in seen}
    assert poses == {(False, "UNKNOWN"), (False, "GOOD"), (True, "GOOD"), (False, "LOST"), (True, "LOST")}
    assert not any(steps.outcome(one) for one in seen)  # nothing that runs brings it back
