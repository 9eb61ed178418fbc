"""Properties that a mission's file wants to hold: read, looked at in all runs, and their counterexamples played."""

from __future__ import annotations

import random
from collections import deque
from html import escape
from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from alula.language.errors import Diagnostic, has_errors
from alula.language.models import ModelFile, check_texts
from alula.language.syntax.properties import property_of_mission
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART
from alula.model.model import Property, Skillset
from alula.prove.limits import Deadline
from alula.prove.mission.conditions import Faults, faults_shown, true_in
from alula.prove.mission.holding import held
from alula.prove.mission.managers import Failures
from alula.prove.mission.play import play
from alula.prove.mission.prover import LOOKED_AT, Proved, prove_mission
from alula.prove.mission.regions import Regions
from alula.prove.mission.run import MissionFinding
from alula.prove.mission.state import State
from alula.prove.mission.system import System
from finding_pages.mission_checks import whole
from finding_pages.mission_proofs import ROBOT

TREE = "<Sequence><drone.lift/><drone.hover/></Sequence><drone.land/>"
WAITS = '<Sequence name="up"><drone.lift/><WaitFor name="ours" if="drone.control == OURS"/></Sequence><drone.land/>'
FAULTS: Faults = {"pilot": frozenset({"drone.control THEIRS"})}


def skillsets() -> tuple[Skillset, ...]:
    (robot,) = check_texts([ModelFile("robot.rl", ROBOT)])
    return tuple(robot.skillsets)


def written(folder: Path, wanted: str, tree: str) -> Path:
    path = folder / "mission.xml"
    path.write_text(whole(f'<Fallback name="mission" _description="{escape(wanted)}">{tree}</Fallback>'))
    return path


def proved(folder: Path, wanted: str, tree: str = TREE, time_s: float = 60.0) -> Proved:
    return prove_mission(MissionFile.read(written(folder, wanted, tree), skillsets(), NO_PART), faults=FAULTS, timeout_s=time_s)


def about(found: Proved) -> list[Diagnostic]:
    return [one for one in found.findings if one.code in {"ALU713", "ALU714"}]


@pytest.mark.parametrize(
    ("wanted", "tree"),
    [
        ("property a: always drone.hover running => drone.axes == USED", TREE),
        ("property  a : always drone.hover running => drone.axes == USED", TREE),
        ("About a property that is always there", TREE),
        ("property a: never drone.lift running and drone.hover running", TREE),
        ("About it; property a: never drone.axes == FREE and drone.land running; accepted ALU702: so be it", TREE),
        ("property a: eventually outcome accomplished or outcome given_up assuming termination", TREE),
        ("property a: fault pilot leads to outcome accomplished or outcome given_up assuming termination", TREE),
        ("property a: drone.lift running leads to drone.hover running or active('drone.land') assuming termination", TREE),
        ("property a: fault pilot leads to active('up') or active('drone.land') or outcome accomplished within 1 ticks", WAITS),
    ],
)
def test_what_holds_is_no_finding(wanted: str, tree: str, tmp_path: Path) -> None:
    found = proved(tmp_path, wanted, tree)
    assert about(found) == []
    assert found.complete


@pytest.mark.parametrize(
    ("wanted", "tree", "words"),
    [
        ("property a: always drone.control == OURS", TREE, "drone.control == THEIRS"),
        ("property a: never drone.hover running and drone.control == THEIRS", TREE, "drone.hover running"),
        ("property a: never active('drone.land')", TREE, "active('drone.land')"),
        ("property a: always not outcome accomplished", TREE, "outcome accomplished"),
        ("property a: eventually outcome accomplished or outcome given_up", TREE, " running"),
        ("property a: eventually drone.hover running assuming termination", TREE, "outcome accomplished"),
        ("property a: fault pilot leads to outcome accomplished assuming termination", WAITS, "active('ours')"),
        ("property a: fault pilot leads to drone.land running or outcome accomplished assuming termination", WAITS, "THEIRS"),
        ("property a: fault pilot leads to active('drone.land') or outcome given_up within 3 ticks", WAITS, "THEIRS"),
    ],
)
def test_what_does_not_hold_has_a_run_that_plays(wanted: str, tree: str, words: str, tmp_path: Path) -> None:
    found = about(proved(tmp_path, wanted, tree))
    assert [one.code for one in found] == ["ALU714"]
    (finding,) = found
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    assert finding.example[-1].startswith("=> ")
    assert words in finding.example[-1]
    played = play(MissionFile.read(tmp_path / "mission.xml", finding.run.skillsets, NO_PART), finding.run)
    assert played.left == ""


@pytest.mark.parametrize(
    ("wanted", "at", "message"),
    [
        ("property a: allways drone.control == OURS", "drone", "expected `.`, found `drone`"),
        ("property a: always drone.control == MINE", "drone.control", "there is no state `MINE` of `drone.control`"),
        ("property a: always drone.legs == MINE", "drone.legs", "there is no resource `legs`"),
        ("property a: always drone.fly running", "drone.fly", "there is no skill `fly`"),
        ("property a: always boat.fly running", "boat", "there is no skillset `boat`"),
        ("property a: always outcome happy", "outcome", "there is no outcome `happy`"),
        ("property a: always active('nobody')", "active", "there is no node `nobody`"),
        ("property a: always active(nobody)", "nobody", "expected the name of a node in quotes"),
        ("property a: fault engine leads to outcome given_up", "fault", "there is no fault that shows in a state `engine`"),
        ("property a: never fault pilot", "fault", "`fault` is something that happens"),
        ("property a: always running(drone.hover)", "running(", "expected a condition, found `running`"),
        ("property a: always drone.hover running -> drone.axes == USED", "->", "expected the end, found `->`"),
        ("property a: always control == OURS", "==", "expected `.`, found `==`"),
        ("property a: drone.control == OURS leads to outcome given_up within 0 ticks", "0", "a number of ticks from 1 to 1000"),
        ("property a: always drone.control == OURS or", "a: always", "found the end"),
        ("property a: always true; property a: never false", "a: always", "there are two properties `a`"),
        ("property a  always drone.control == OURS", "property", "a property has a name and a colon"),
        ("@property never drone.hover running", "property", "a property has a name and a colon"),
    ],
)
def test_a_bad_property_is_one_error_with_place_and_cure(wanted: str, at: str, message: str, tmp_path: Path) -> None:
    found = about(proved(tmp_path, wanted))
    assert found
    assert {one.code for one in found} == {"ALU713"}
    assert message in found[0].message
    assert found[0].hint
    line = (tmp_path / "mission.xml").read_text().splitlines()[found[0].span.line - 1]
    assert found[0].span.column == 1 + line.index(escape(wanted)) + len(escape(wanted[: wanted.index(at)])) or "found the end" in message


@pytest.mark.parametrize(
    ("wanted", "remedy"),
    [
        ("property a: always running(drone.hover) => drone.axes == USED", "write `drone.hover running`"),
        ("property a: always drone.hover running -> drone.axes == USED", "write `=>` for `->`"),
    ],
)
def test_the_words_of_scripts_are_refused_with_those_of_properties(wanted: str, remedy: str, tmp_path: Path) -> None:
    (found,) = about(proved(tmp_path, wanted))
    assert found.hint == remedy


def test_a_bound_of_a_property_is_never_silent(tmp_path: Path) -> None:
    found = proved(tmp_path, "property a: eventually outcome accomplished or outcome given_up assuming termination", time_s=0.0)
    assert not found.complete
    assert [one.code for one in found.findings] == ["ALU710"]


# --- held against one situation after another -------------------------------------------------------------------------

ATOMS = (
    "drone.control == OURS",
    "drone.axes != FREE",
    "drone.hover running",
    "drone.lift running",
    "active('drone.land')",
    "active('some')",
    "outcome given_up",
    "outcome accomplished",
)
TREES = (
    TREE,
    WAITS,
    '<Parallel name="some" success_count="1" failure_count="1"><drone.lift/><Sleep msec="200"/></Parallel><drone.land/>',
    '<RetryUntilSuccessful num_attempts="2"><drone.hover/></RetryUntilSuccessful><Inverter><drone.lift/></Inverter>',
    '<Timeout msec="300"><drone.lift/></Timeout>'
    '<ReactiveFallback><ScriptCondition code="drone.axes == USED"/><drone.land/></ReactiveFallback>',
)


def condition(chance: random.Random, depth: int = 2) -> str:
    if not depth or chance.random() < 0.2:
        return chance.choice(ATOMS)
    kind = chance.choice(("and", "or", "=>", "not"))
    if kind == "not":
        return f"not ({condition(chance, depth - 1)})"
    return f"(({condition(chance, depth - 1)}) {kind} ({condition(chance, depth - 1)}))"


def read(text: str) -> Property:
    one = property_of_mission(text, "the end")
    assert isinstance(one, Property)
    return one


@pytest.mark.parametrize("seed", range(10))
def test_single_situations_are_those_that_are_reached_one_after_another(seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)  # noqa: S311 - for tests
    path = written(tmp_path, "", '<AlwaysFailure name="some"/>' + TREES[seed % len(TREES)])
    system = System.of(MissionFile.read(path, skillsets(), NO_PART), Failures(refusals=False, hooks=seed % 2 == 0, aborts=False))
    regions = Regions(system, Deadline.after(100.0))
    regions.explore()
    states = reached(system)
    for _ in range(30):
        one = read(f"p: {chance.choice(('never', 'always'))} {condition(chance)}")
        wrong = [state for state in states if true_in(system, one.condition, state) == (one.kind.value == "never")]
        seen = held(regions, one, FAULTS, Deadline.after(100.0))
        assert seen.complete
        assert (seen.finding is None) == (not wrong)


def reached(system: System) -> set[State]:
    first = system.initial()
    seen, todo = {first}, deque([first])
    while todo:
        for _, after in system.steps(todo.popleft()):
            if after not in seen:
                seen.add(after)
                todo.append(after)
    return seen


@pytest.mark.parametrize("seed", range(10))
def test_a_run_against_what_must_come_never_sees_it(seed: int, tmp_path: Path) -> None:
    """And where there is none, no random run comes to rest without it."""
    chance = random.Random(seed)  # noqa: S311 - for tests
    path = written(tmp_path, "", '<AlwaysFailure name="some"/>' + TREES[seed % len(TREES)])
    system = System.of(MissionFile.read(path, skillsets(), NO_PART), LOOKED_AT)
    regions = Regions(system, Deadline.after(100.0))
    regions.explore()
    for _ in range(20):
        one = read(f"p: {condition(chance)} leads to {condition(chance)} assuming termination")
        seen = held(regions, one, FAULTS, Deadline.after(100.0))
        assert seen.complete
        assert one.consequence is not None
        if seen.finding is not None:
            assert seen.finding.run is not None
            left = play(MissionFile.read(path, seen.finding.run.skillsets, NO_PART), seen.finding.run).left
            assert left == "" or left.endswith("which no play can bring about")
            continue
        for _ in range(20):
            assert not waits_at_an_end(system, chance, one)


def waits_at_an_end(system: System, chance: random.Random, one: Property) -> bool:
    """Return whether a random run that goes on until the mission is over leaves something to come."""
    assert one.consequence is not None
    state, waits = system.initial(), False
    for _ in range(400):
        shown: frozenset[str] = frozenset()
        steps = list(system.steps(state))
        if not steps:
            return waits
        event, state = chance.choice(steps)
        shown = faults_shown(event, FAULTS)
        waits = waits or (system.started(state) and true_in(system, one.condition, state, shown))
        waits = waits and not true_in(system, one.consequence, state)
    return False


# --- refusals ---------------------------------------------------------------------------------------------------------

EYES = """
skillset eyes {
  resource lens { state { CLEAR DIRTY } initial CLEAR transition { extern CLEAR -> DIRTY  extern DIRTY -> CLEAR } }
  skill look { precondition clear: lens == CLEAR success SEEN }
}
"""


def test_a_race_between_a_condition_and_a_request_is_told_and_plays(tmp_path: Path) -> None:
    (robot,) = check_texts([ModelFile("eyes.rl", EYES)])
    path = written(tmp_path, "", '<Sequence><ScriptCondition code="eyes.lens == CLEAR"/><eyes.look/></Sequence>')
    (finding,) = prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).findings
    assert finding.code == "ALU705"
    assert "NOT_READY (clear), because after the tree has asked eyes.lens CLEAR -> DIRTY" in finding.message
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    played = play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run)
    assert (played.left, played.end.outcome.value) == ("", "given_up")


def test_a_request_that_fails_in_both_ways_has_both_findings(tmp_path: Path) -> None:
    found = proved(tmp_path, "", "<Sequence><ForceSuccess><drone.climb/></ForceSuccess><drone.hover/></Sequence>")
    assert {"ALU702", "ALU705"} <= {one.code for one in found.findings}
    assert all("is refused" not in "".join(one.example[-1:]) for one in found.findings if one.code == "ALU702")


WATCHING = """
skillset eyes {
  resource light { state { ON OFF } initial ON transition { extern ON -> OFF  extern OFF -> ON } }
  skill watch { invariant { lit { guard light == ON } } success DONE failure LOST }
}
"""


def test_a_refusal_is_told_where_a_tick_needs_more_of_another_skillset(tmp_path: Path) -> None:
    """The tick that sees the refusal is taken with managers of `eyes` that more steps lead to than to any that go with the refusal."""
    (robot,) = check_texts([ModelFile("both.rl", WATCHING + ROBOT)])
    first = "<drone.land/><Sequence><drone.hover/><drone.climb/></Sequence>"
    both = "".join(f'<Parallel success_count="1" failure_count="1">{one}</Parallel>' for one in (first, "<drone.land/><eyes.watch/>"))
    path = written(tmp_path, "", f"<Fallback>{both}</Fallback>")
    found = [one for one in prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).findings if one.code == "ALU705"]
    assert found
    for one in found:
        assert isinstance(one, MissionFinding)
        assert one.run is not None
        assert not play(MissionFile.read(path, one.run.skillsets, NO_PART), one.run).left


REACHING = """
skillset arm {
  skill reach { input { height: float64 } success DONE }
}
"""


def test_inputs_that_a_function_may_refuse_need_an_answer_and_the_refusal_plays(tmp_path: Path) -> None:
    (robot,) = check_texts([ModelFile("arm.rl", REACHING)])
    path = written(tmp_path, "", '<arm.reach height="1.0"/>')
    (finding,) = prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).findings
    assert (finding.code, "is refused: NOT_VALIDATED" in finding.message) == ("ALU705", True)
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    played = play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run)
    assert (played.left, played.end.outcome.value) == ("", "given_up")
    path = written(tmp_path, "", '<Fallback><arm.reach height="1.0"/><AlwaysFailure/></Fallback>')
    assert prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).findings == []


DRIVING = """
skillset rover {
  resource wheels { state { FREE USED } initial FREE transition { FREE -> USED USED -> FREE } }
  skill look { progress { period 0.5 } }
  skill drive { start wheels -> USED interrupt { effect wheels -> FREE } success DONE { effect wheels -> FREE } }
}
"""


def test_progress_that_a_script_waits_for_is_played(tmp_path: Path) -> None:
    (robot,) = check_texts([ModelFile("rover.rl", DRIVING)])
    assert not has_errors(robot.findings)
    tree = '<Sequence><WaitFor if="progress(rover.look) &gt;= 0.7"/><rover.drive/></Sequence>'
    path = written(tmp_path, "property still: never rover.drive running", PARALLEL.format(f"<rover.look/>{tree}"))
    (finding,) = (one for one in prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).findings if one.code == "ALU714")
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    assert play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run).left == ""


PARALLEL = '<Parallel success_count="1" failure_count="1">{}</Parallel>'


# --- what never decides, what never comes, who fights -----------------------------------------------------------------


def codes(folder: Path, tree: str) -> set[str]:
    return {one.code for one in prove_mission(MissionFile.read(written(folder, "", tree), skillsets(), NO_PART)).findings}


FIGHT = """<Parallel success_count="2" failure_count="2">
  <Fallback><drone.hover/><AlwaysFailure/></Fallback>
  <Fallback>{land}<AlwaysFailure/></Fallback>
</Parallel>"""
AGAIN = '<RetryUntilSuccessful num_attempts="3"><drone.land/></RetryUntilSuccessful>'


def test_who_fights_for_a_resource_is_told_and_plays(tmp_path: Path) -> None:
    path = written(tmp_path, "", FIGHT.format(land=AGAIN))
    (finding,) = (one for one in prove_mission(MissionFile.read(path, skillsets(), NO_PART)).findings if one.code == "ALU708")
    assert "'drone.land' and 'drone.hover' fight for drone.axes" in finding.message
    assert [line.split(". ")[1] for line in finding.example][-2:] == [
        "drone.land is refused: NOT_READY (free)",
        "the tree is ticked; asks for drone.land ('drone.land')",
    ]
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    assert not play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run).left


def test_one_refusal_is_no_fight_nor_is_asking_again_once_it_is_free(tmp_path: Path) -> None:
    waits = '<WaitFor if="running(drone.hover)"/><WaitFor if="!running(drone.hover)"/>'  # a request under way does not run yet
    for land in ("<drone.land/>", f"<Sequence>{waits}{AGAIN}</Sequence>"):
        assert "ALU708" not in codes(tmp_path, FIGHT.format(land=land)), land


def test_a_condition_decides_where_it_can_be_otherwise_in_one_of_its_places(tmp_path: Path) -> None:
    asks = '<Sequence><ScriptCondition code="drone.axes == FREE"/><drone.lift/></Sequence>'
    assert "ALU706" in codes(tmp_path, f"<Fallback>{asks}<drone.land/></Fallback>")
    inside = f"<ForceSuccess><drone.climb/></ForceSuccess><Fallback>{asks}<AlwaysFailure/></Fallback>"
    assert "ALU706" not in codes(tmp_path, f"<Sequence>{inside}</Sequence>")
    assert "ALU706" in codes(tmp_path, '<Fallback><ScriptCondition code="drone.axes == USED"/><drone.lift/><drone.land/></Fallback>')
    assert "ALU706" not in codes(tmp_path, '<Sequence><WaitFor if="drone.control == OURS"/><drone.lift/></Sequence>')


def test_an_outcome_that_never_comes_is_told_of_the_skills_that_write_it(tmp_path: Path) -> None:
    tree = """<Fallback>
      <drone.hover outcome="{{how}}"/>
      <Sequence><ScriptCondition code="how {asked}"/><drone.lift/></Sequence>
      <drone.land/>
    </Fallback>"""
    found = prove_mission(MissionFile.read(written(tmp_path, "", tree.format(asked="== 'NOT_READY'")), skillsets(), NO_PART)).findings
    assert [one.message for one in found if one.code == "ALU707"] == ["`how == 'NOT_READY'` is asked, but 'drone.hover' never ends so"]
    assert "ALU707" not in codes(tmp_path, tree.format(asked="== 'ABORTED'"))
    also = "<Sequence><Script code=\"how := 'NOT_READY'\"/>" + tree.format(asked="== 'NOT_READY'") + "</Sequence>"
    assert "ALU707" not in codes(tmp_path, also)
