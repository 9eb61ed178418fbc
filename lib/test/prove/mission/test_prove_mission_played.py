"""Counterexamples about missions, played: the real mission and the real managers come to the same end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from alula.check.robot import models_of, part_of
from alula.common.robots import find_robot
from alula.language.models import ModelFile, check_texts
from alula.missions.director import Outcome
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.play import play
from alula.prove.mission.prover import LOOKED_AT, prove_mission, prove_within
from alula.prove.mission.regions import Regions
from alula.prove.mission.responses import FailureResponses
from alula.prove.mission.run import MissionFinding, MissionRun
from alula.prove.mission.state import Kind
from alula.prove.mission.system import System
from alula.records.causes.fault_file import states_of_faults
from finding_pages.examples import RUNS, examples
from finding_pages.mission_checks import whole
from finding_pages.mission_proofs import ROBOT

ROOT = Path(__file__).resolve().parents[4]
EXAMPLES = examples(RUNS)


class Few(Deadline):
    """A bound of regions in the place of one of time."""

    left = 120

    def check(self) -> None:
        """Raise OutOfTimeError after so many."""
        self.left -= 1
        if self.left <= 0:
            raise OutOfTimeError("enough")


def found(folder: Path, code: str) -> tuple[Path, list[MissionFinding]]:
    (robot,) = check_texts([ModelFile("robot.rl", ROBOT)])
    path = folder / "example.xml"
    path.write_text(whole(EXAMPLES[code].broken))
    findings = prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).findings
    return path, [one for one in findings if isinstance(one, MissionFinding) and one.run is not None]


@pytest.mark.parametrize("code", ["ALU701", "ALU702", "ALU704", "ALU714"])
def test_the_examples_play_to_their_end(code: str, tmp_path: Path) -> None:
    path, findings = found(tmp_path, code)
    assert findings
    for finding in findings:
        assert finding.run is not None
        played = play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run)
        goes_on = code in {"ALU704", "ALU714"}
        assert finding.run.outcome == ("running" if goes_on else "given_up")
        assert (played.left, played.end.outcome) == ("", Outcome.ABORTED if goes_on else Outcome.GIVEN_UP)


KEEPING = ROBOT.replace("ours { guard control == OURS effect axes -> FREE }", "ours { guard control == OURS }")


def test_each_end_that_leaves_something_taken_is_told_and_plays(tmp_path: Path) -> None:
    """The managers are the same after both ends: what is accepted of one must not hide the other."""
    assert KEEPING != ROBOT
    (robot,) = check_texts([ModelFile("robot.rl", KEEPING)])
    path = tmp_path / "example.xml"
    inside = "<Sequence><drone.lift/><drone.climb/></Sequence><drone.land/>"
    path.write_text(whole(f"<Fallback>{inside}</Fallback>"))
    found = [one for one in prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).findings if one.code == "ALU701"]
    assert [one.message.partition(": left by ")[2] for one in found] == ["drone.lift as ours", "drone.climb as ours"]
    for one in found:
        assert isinstance(one, MissionFinding)
        assert one.run is not None
        assert play(MissionFile.read(path, one.run.skillsets, NO_PART), one.run).left == ""
    path.write_text(whole(f'<Fallback _description="accepted ALU701 (left by drone.lift as ours): so it is">{inside}</Fallback>'))
    proved = prove_mission(MissionFile.read(path, robot.skillsets, NO_PART))
    assert [one.message[-19:] for one in proved.findings if one.code == "ALU701"] == ["drone.climb as ours"]
    assert len(proved.accepted) == 1


DATA = """
skillset rover {
  type { Float64 }
  data { charge: Float64 }
  resource wheels { state { FREE USED } initial FREE transition { FREE -> USED USED -> FREE } }
  skill drive {
    precondition charged: charge > 20
    start wheels -> USED
    invariant { enough { guard charge > 10 effect wheels -> FREE } }
    interrupt { effect wheels -> FREE }
    success DONE { effect wheels -> FREE }
  }
}
"""


TELLING = """
<Fallback>
  <rover.drive outcome="{why}"/>
  <Sequence><ScriptCondition code="why == 'enough'"/><AlwaysFailure/></Sequence>
  <Sequence><ScriptCondition code="why == 'charged'"/><AlwaysFailure/></Sequence>
</Fallback>
"""


def test_data_that_break_an_invariant_or_refuse_are_played(tmp_path: Path) -> None:
    (robot,) = check_texts([ModelFile("robot.rl", DATA)])
    assert not [one for one in robot.findings if one.code.startswith("ALU0")]
    path = tmp_path / "mission.xml"
    path.write_text(whole(TELLING))
    system = System.of(MissionFile.read(path, robot.skillsets, NO_PART), LOOKED_AT)
    regions = Regions(system, Deadline.after(60.0))
    regions.explore()
    rows = {(row.skill, row.end): row for row in FailureResponses(regions).rows}
    kinds = set()
    for row in rows.values():
        events, state = regions.run_on(row.region, *row.way)
        outcome = system.outcome(state)
        assert outcome is not None
        kinds |= {event.kind for event in events}
        run = MissionRun(tuple(events), outcome.value, (("rover.wheels", "FREE"),), system.skillsets)
        played = play(MissionFile.read(path, run.skillsets, NO_PART), run)
        assert (played.left, played.end.outcome) == ("", Outcome.GIVEN_UP)
    assert {Kind.REFUSE, Kind.BREAK} <= kinds


def test_a_run_that_does_not_happen_is_left_where_it_does_not(tmp_path: Path) -> None:
    path, (finding, *_) = found(tmp_path, "ALU701")
    assert finding.run is not None
    events = tuple(one for one in finding.run.events if not one.changes or one.name != "control")
    played = play(MissionFile.read(path, finding.run.skillsets, NO_PART), replace(finding.run, events=events))
    assert "at step" in played.left
    name, state = finding.run.states[0]
    other = replace(finding.run, states=((name, "ELSEWHERE"), *finding.run.states[1:]))
    played = play(MissionFile.read(path, finding.run.skillsets, NO_PART), other)
    assert played.left == f"at the end {name} is {state} in the managers, ELSEWHERE in the counterexample"


def test_the_axes_that_listing_3_keeps_are_kept_in_a_flight(tmp_path: Path) -> None:
    robot, path = find_robot(ROOT), ROOT / "missions" / "mapping.xml"
    part, models = part_of(robot, print), models_of(robot, print)
    file = MissionFile.read(path, models, part)
    (finding,) = next(prove_within(Few.after(1e6), file, faults=states_of_faults(models, print), given="this test")).accepted
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    assert ("navigation.axes_authority", "USED") in finding.run.states
    played = play(MissionFile.read(path, finding.run.skillsets, part), finding.run, tmp_path)
    assert (played.left, played.end.outcome) == ("", Outcome.GIVEN_UP)
    assert (tmp_path / "skills.mcap").is_file()


EITHER = '<WaitFor name="told" if="drone.control == OURS || drone.control == THEIRS"/>'
TOLD = f"<Fallback><Sequence><drone.lift/>{EITHER}</Sequence><drone.land/></Fallback>"
STOP = '<BehaviorTree ID="stop_here"><WaitFor name="theirs" if="drone.control == THEIRS"/></BehaviorTree></root>'
ABORTED = (
    whole("<Fallback><drone.lift/><drone.land/></Fallback>")
    .replace("</root>", STOP)
    .replace("<root", '<root main_tree_to_execute="mission"')
)


@pytest.mark.parametrize(("text", "node", "kind"), [(whole(TOLD), "told", Kind.DIE), (ABORTED, "theirs", Kind.ABORT)])
def test_what_models_say_nothing_of_is_looked_at_and_plays(text: str, node: str, kind: Kind, tmp_path: Path) -> None:
    """Managers that stay dead, and an abort after which nothing ends."""
    (robot,) = check_texts([ModelFile("robot.rl", ROBOT)])
    path = tmp_path / "mission.xml"
    path.write_text(text)
    (finding,) = (one for one in prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).findings if one.code == "ALU704")
    assert f"waits in '{node}' for ever" in finding.message
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    assert kind in {event.kind for event in finding.run.events}
    assert play(MissionFile.read(path, finding.run.skillsets, NO_PART), finding.run).left == ""
    known = next(prove_within(Deadline.after(60.0), MissionFile.read(path, robot.skillsets, NO_PART), given="this test")).findings
    assert "ALU704" not in {one.code for one in known}


LEFT = '<ForceSuccess><Timeout msec="100"><drone.hover/></Timeout></ForceSuccess><WaitFor if="!running(drone.hover)"/><drone.lift/>'


def test_a_script_may_ask_for_what_was_left_wherever_the_mission_may_be_paused(tmp_path: Path) -> None:
    (robot,) = check_texts([ModelFile("robot.rl", ROBOT)])
    path = tmp_path / "mission.xml"
    path.write_text(whole(f"<Fallback><Sequence>{LEFT}</Sequence><drone.land/></Fallback>"))
    assert prove_mission(MissionFile.read(path, robot.skillsets, NO_PART)).complete
