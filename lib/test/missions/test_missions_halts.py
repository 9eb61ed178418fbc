"""What a halt leaves: an outcome for each skill, and no skill that runs, whatever breaks while the tree is left."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("py_trees")

from alula.common import run_log
from alula.common.record import read_record
from alula.language.models import ModelFile, check_texts
from alula.missions.director import Outcome
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import LIMIT_S, STOP_S, MockedMission
from alula.missions.part import NO_PART
from alula.mock import load_behaviour

MODEL = """
skillset rover { resource wheels { state { FREE USED } initial FREE transition { FREE -> USED USED -> FREE } }
  skill drive { success ARRIVED {} }
  skill look { success SEEN {} }
}
"""
MOCK = "skills: {rover.drive: {delay: 100}, rover.look: {delay: 1.5}}"
ABORT_S = 5.0
STOP = '<BehaviorTree ID="stop_here"><rover.look name="stop"/></BehaviorTree>'


class Flown:
    """A mission over mocks whose main tree has this body; aborted, if it is, at ABORT_S."""

    def __init__(self, folder: Path, body: str, stop: str = STOP, *, abort: bool = False, limit_s: float = LIMIT_S) -> None:
        (file,) = check_texts([ModelFile("rover.rl", MODEL)])
        assert [one for one in file.findings if one.severity.value == "error"] == []
        text = f'<root BTCPP_format="4" main_tree_to_execute="m"><BehaviorTree ID="m">{body}</BehaviorTree>{stop}</root>'
        (folder / "m.xml").write_text(text, encoding="utf-8")
        (folder / "mock.yaml").write_text(MOCK, encoding="utf-8")
        (folder / "run").mkdir()
        plan = plan_of_file(folder / "m.xml", "m", file.skillsets, {}, NO_PART)
        behaviour = load_behaviour([folder / "mock.yaml"], file.skillsets)
        self.mission = MockedMission(file.skillsets, behaviour, plan, out=folder / "run", limit_s=limit_s)
        if abort:
            self.mission.world.clock.after(ABORT_S, lambda: self.mission.abort("told to end"))
        self.end = self.mission.run()
        self.written = run_log.account(folder / "run", read_record(folder / "run"))

    @property
    def entries(self) -> dict[str, object]:
        return dict(self.mission.director.context.entries())

    @property
    def stopped(self) -> bool:
        """Return whether the tree `stop_here` was flown to its end."""
        return any(event.skill == "look" and event.state.value == "TERMINATED" for event in self.mission.events if hasattr(event, "skill"))


def test_a_halted_skill_is_interrupted_and_the_script_of_its_halt_knows_it(tmp_path: Path) -> None:
    leaf = '<rover.drive outcome="{why}" _onHalted="seen := why"/>'
    flown = Flown(tmp_path, f'<Parallel success_count="1"><Sleep msec="1500"/>{leaf}</Parallel>')
    assert (flown.entries["why"], flown.entries["seen"]) == ("INTERRUPTED", "INTERRUPTED")


def test_a_halted_skill_that_waits_for_its_start_has_not_the_outcome_of_before(tmp_path: Path) -> None:
    first = '<Parallel success_count="1"><rover.drive name="first"/><AlwaysSuccess/></Parallel>'
    waits = '<rover.drive name="waits" outcome="{why}"/>'
    body = f'<Sequence><Script code="why := \'ARRIVED\'"/>{first}<Timeout msec="1">{waits}</Timeout></Sequence>'
    flown = Flown(tmp_path, body)
    assert "waits" not in {path[-1] for path in flown.mission.places.values()}
    assert flown.entries["why"] == "INTERRUPTED"


BROKEN = '<Script code="nothing += 1"/>'
BREAKS_HALTED = '<Parallel failure_count="1"><rover.drive _onHalted="nothing += 1"/><rover.drive/>'


@pytest.mark.parametrize(
    "body",
    [
        # In the first tick of all: no node above the skill runs yet when its neighbour breaks.
        f'<Parallel failure_count="1"><rover.drive/>{BROKEN}</Parallel>',
        f'<Sequence><Sleep msec="500"/><Parallel failure_count="1"><rover.drive/>{BROKEN}</Parallel></Sequence>',
        # A halt that breaks keeps no other from being halted.
        f"{BREAKS_HALTED}<Sequence><Sleep msec='500'/>{BROKEN}</Sequence></Parallel>",
        f"{BREAKS_HALTED}<Sequence><Sleep msec='500'/><AlwaysFailure/></Sequence></Parallel>",
        '<Parallel success_count="1"><rover.drive _onHalted="why := 2 - nothing"/><Sleep msec="500"/></Parallel>',
    ],
)
def test_a_tree_that_breaks_leaves_no_skill_that_runs(body: str, tmp_path: Path) -> None:
    flown = Flown(tmp_path, body)
    assert flown.end.outcome is Outcome.ABORTED
    assert "the tree raised TickError" in flown.end.reason
    assert "nothing" in flown.end.reason
    assert flown.mission.open_executions == []
    assert flown.stopped


@pytest.mark.parametrize("attributes", ["", '_onHalted="nothing += 1"'])
def test_an_abort_brings_it_to_rest_whatever_a_halt_breaks(attributes: str, tmp_path: Path) -> None:
    flown = Flown(tmp_path, f'<Parallel failure_count="1"><rover.drive {attributes}/><rover.drive/></Parallel>', abort=True)
    assert flown.end.outcome is Outcome.ABORTED
    assert flown.end.reason.startswith("told to end")
    assert ("nothing" in flown.end.reason) is bool(attributes)
    assert flown.mission.open_executions == []
    assert flown.stopped


def test_a_tree_that_breaks_on_the_way_to_rest_is_left_for_stop_here(tmp_path: Path) -> None:
    body = f'<Sequence><Script code="stopping := true"/><Parallel failure_count="1"><rover.drive/>{BROKEN}</Parallel></Sequence>'
    flown = Flown(tmp_path, body)
    assert (flown.end.outcome, flown.mission.open_executions, flown.stopped) == (Outcome.ABORTED, [], True)


@pytest.mark.parametrize("stop", [f"<Parallel><rover.drive/>{BROKEN}</Parallel>", f"<Sequence><rover.look/>{BROKEN}</Sequence>"])
def test_a_stop_that_breaks_ends_with_nothing_that_runs(stop: str, tmp_path: Path) -> None:
    flown = Flown(tmp_path, "<rover.drive/>", f'<BehaviorTree ID="stop_here">{stop}</BehaviorTree>', abort=True)
    assert flown.end.outcome is Outcome.ABORTED
    assert flown.end.reason.startswith("told to end; then the tree raised TickError")
    assert flown.mission.open_executions == []


def test_without_a_tree_that_stops_an_abort_interrupts_what_runs(tmp_path: Path) -> None:
    flown = Flown(tmp_path, "<rover.drive/>", "", abort=True)
    assert (flown.end.outcome, flown.end.reason) == (Outcome.ABORTED, "told to end")
    assert flown.mission.open_executions == []


READY = """<BehaviorTree ID="ready"><Needs name="it is free" if="rover.wheels == FREE ? zz == 1 : false"/></BehaviorTree>"""


def test_what_the_mission_needs_and_can_not_be_asked_moves_nothing(tmp_path: Path) -> None:
    flown = Flown(tmp_path, "<rover.drive/>", READY + STOP)
    assert flown.end.outcome is Outcome.NOT_STARTED
    assert "zz" in flown.end.reason
    assert flown.mission.events == []
    assert flown.written["outcome"] == "not_started"


ATTEMPTS = (-3, -1, 0, 1, 2, 5)


@pytest.mark.parametrize("by_entry", [False, True])
@pytest.mark.parametrize("attempts", ATTEMPTS)
def test_attempts_count_as_those_of_retry_until_successful(attempts: int, by_entry: bool, tmp_path: Path) -> None:  # noqa: FBT001
    """A skill that always ends without success is asked for so often; -1: until it is aborted."""
    leaf = '<rover.look success="NEVER" name="look at it"/>'
    began = {}
    for tag, port in (("RetryAfter", "attempts"), ("RetryUntilSuccessful", "num_attempts")):
        retry = f'<{tag} {port}="{"{n}" if by_entry else attempts}">{leaf}</{tag}>'
        (tmp_path / tag).mkdir()
        flown = Flown(tmp_path / tag, f'<Sequence><Script code="n := {attempts}"/>{retry}</Sequence>', abort=attempts == -1)
        assert flown.end.outcome is (Outcome.ABORTED if attempts == -1 else Outcome.GIVEN_UP)
        began[tag] = sum(path[-1:] == ("look at it",) for path in flown.mission.places.values())
    if attempts == -1:
        assert min(began.values()) > 1
    else:
        assert set(began.values()) == {max(attempts, 0)}


@pytest.mark.parametrize("wait", ["nan", "inf", "-inf"])
def test_a_time_that_is_none_is_told_with_its_place(wait: str, tmp_path: Path) -> None:
    retry = '<RetryAfter if="1" wait="{w}"><AlwaysFailure/></RetryAfter>'
    flown = Flown(tmp_path, f"<Sequence><Script code=\"w := '{wait}'\"/>{retry}</Sequence>")
    assert flown.end.outcome is Outcome.ABORTED
    assert "'wait'" in flown.end.reason


@pytest.mark.parametrize("stop", [STOP, '<BehaviorTree ID="stop_here"><WaitFor if="false"/></BehaviorTree>'])
def test_a_mission_without_end_has_a_limit_and_its_record_with_it(stop: str, tmp_path: Path) -> None:
    """So has a stop without end."""
    flown = Flown(tmp_path, '<Repeat num_cycles="-1"><Sleep msec="10"/></Repeat>', stop, limit_s=3.0)
    assert (flown.end.outcome, flown.end.reason.split(";")[0]) in {
        (Outcome.ABORTED, "its limit of 3 s is over"),
        (Outcome.ABORTED, "the stop did not end"),
    }
    assert flown.mission.world.now_s < 3.0 + STOP_S + 1.0
