"""Missions that wait for ever, or go round without end: found, played, and held against one situation after another."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from test_prove_mission_wanted import FAULTS, TREE, TREES, proved, read, skillsets, written

from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.ending import Ending
from alula.prove.mission.holding import held
from alula.prove.mission.play import play
from alula.prove.mission.prover import LOOKED_AT
from alula.prove.mission.regions import Regions
from alula.prove.mission.run import MissionFinding
from alula.prove.mission.system import System
from alula.prove.mission.waits import Waits

ROUNDS = (
    ('<Sequence><drone.lift/><WaitFor name="ours" if="drone.control == OURS"/></Sequence><drone.land/>', "waits in 'ours' for ever"),
    ('<KeepRunningUntilFailure name="again"><drone.hover/></KeepRunningUntilFailure>', "goes round 'again' without end"),
    (
        '<RetryUntilSuccessful num_attempts="-1"><Sequence><drone.lift/><ScriptCondition code="drone.control == OURS"/></Sequence>'
        "</RetryUntilSuccessful>",
        "goes round 'drone.lift' without end",
    ),
)
ENDING = (
    TREE,
    '<Timeout msec="9000"><WaitFor if="drone.control == THEIRS"/></Timeout>',
    '<RetryUntilSuccessful num_attempts="3"><Inverter><drone.hover/></Inverter></RetryUntilSuccessful><drone.land/>',
    '<Parallel success_count="1" failure_count="1"><drone.hover/>'
    '<WaitFor if="progress(drone.hover) &gt;= 1 || drone.control == OURS || drone.control == THEIRS"/></Parallel>',
)


@pytest.mark.parametrize(("tree", "words"), ROUNDS)
def test_a_mission_that_never_ends_is_found_and_plays(tree: str, words: str, tmp_path: Path) -> None:
    (finding,) = (one for one in proved(tmp_path, "", tree).findings if one.code == "ALU704")
    assert words in finding.message
    assert isinstance(finding, MissionFinding)
    assert finding.run is not None
    assert play(MissionFile.read(tmp_path / "mission.xml", finding.run.skillsets, NO_PART), finding.run).left == ""


@pytest.mark.parametrize("tree", ENDING)
def test_a_mission_that_ends_does_not_wait(tree: str, tmp_path: Path) -> None:
    found = proved(tmp_path, "", tree)
    assert found.complete
    assert "ALU704" not in {one.code for one in found.findings}


@pytest.mark.parametrize("seed", range(12))
def test_waits_are_those_of_the_search_one_situation_after_another(seed: int, tmp_path: Path) -> None:
    """Two ways to the same answer: at rest, from tick to tick, and by what the mission must come to."""
    chance = random.Random(seed)  # noqa: S311 - for tests
    trees = [chance.choice((*TREES, *ENDING, *(tree for tree, _ in ROUNDS)))]
    path = written(tmp_path, "", "".join(trees))
    system = System.of(MissionFile.read(path, skillsets(), NO_PART), LOOKED_AT)
    regions = Regions(system, Deadline.after(100.0))
    regions.explore()
    ends = " or ".join(f"outcome {one}" for one in ("accomplished", "degraded", "given_up", "aborted"))
    comes = held(regions, read(f"p: eventually {ends} assuming termination"), FAULTS, Deadline.after(100.0))
    assert comes.complete
    assert any(Waits(regions).found(Deadline.after(100.0))) == (comes.finding is not None)


COMES = ("outcome accomplished or outcome degraded or outcome given_up", "outcome given_up", "drone.axes == FREE", "drone.land running")


@pytest.mark.parametrize("tree", [*TREES, *ENDING, *(tree for tree, _ in ROUNDS)])
@pytest.mark.parametrize("comes", COMES)
def test_what_is_the_case_at_each_end_comes_where_each_run_ends(tree: str, comes: str, tmp_path: Path) -> None:
    """Two ways to the same answer: by the ends, where they decide it, and one situation after another."""
    system = System.of(MissionFile.read(written(tmp_path, "", tree), skillsets(), NO_PART), LOOKED_AT)
    regions = Regions(system, Deadline.after(100.0))
    regions.explore()
    looked = Waits(regions)
    waits = any(looked.found(Deadline.after(100.0)))
    assert looked.always_ends != waits
    wanted = read(f"p: fault pilot leads to {comes} assuming termination")
    by_steps, by_ends = (held(regions, wanted, FAULTS, Deadline.after(100.0), always_ends=one) for one in (False, looked.always_ends))
    assert by_steps.complete
    assert (by_ends.finding is None) == (by_steps.finding is None)


@pytest.mark.parametrize("tree", [*TREES, *ENDING, *(tree for tree, _ in ROUNDS)])
def test_groups_after_which_a_mission_surely_ends_hide_no_wait(tree: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    regions = Regions(System.of(MissionFile.read(written(tmp_path, "", tree), skillsets(), NO_PART), LOOKED_AT), Deadline.after(100.0))
    regions.explore()

    def found() -> tuple[list[object], bool]:
        looked = Waits(regions)
        return list(looked.found(Deadline.after(100.0))), looked.always_ends

    by_groups = found()
    monkeypatch.setattr(Ending, "doubtful", lambda ending, _values, _deadline: ending.groups)
    assert found() == by_groups


def test_situations_at_rest_of_several_regions_are_looked_at_once(tmp_path: Path) -> None:
    regions = Regions(System.of(MissionFile.read(written(tmp_path, "", TREE), skillsets(), NO_PART), LOOKED_AT), Deadline.after(100.0))
    regions.explore()
    looked = Waits(regions)
    groups = list(looked._groups(Deadline.after(100.0)))
    again = [group._replace(region=group.region + len(groups)) for group in groups]
    assert Ending(regions, [*groups, *again], looked._at_rest_after).groups == groups


def test_what_every_end_brings_needs_no_search(tmp_path: Path) -> None:
    regions = Regions(System.of(MissionFile.read(written(tmp_path, "", TREE), skillsets(), NO_PART), LOOKED_AT), Deadline.after(100.0))
    regions.explore()
    ends = " or ".join(f"outcome {one}" for one in ("accomplished", "degraded", "given_up"))
    wanted = read(f"p: fault pilot leads to {ends} assuming termination")
    assert held(regions, wanted, FAULTS, Steps.after(1e6), always_ends=True).complete
    assert not held(regions, wanted, FAULTS, Steps.after(1e6)).complete


class Steps(Deadline):
    """A bound of steps in the place of one of time."""

    left = 0

    def check(self) -> None:
        """Raise OutOfTimeError after so many."""
        self.left -= 1
        if self.left < 0:
            raise OutOfTimeError


def test_waits_that_are_told_when_the_time_is_over_are_waits(tmp_path: Path) -> None:
    path = written(tmp_path, "", "".join(tree for tree, _ in ROUNDS[:1]))
    regions = Regions(System.of(MissionFile.read(path, skillsets(), NO_PART), LOOKED_AT), Deadline.after(100.0))
    regions.explore()
    whole_time = [node.name for node, *_ in Waits(regions).found(Deadline.after(100.0))]
    assert whole_time == ["ours"]
    told = []
    for most in range(60):
        deadline = Steps.after(1e6)
        deadline.left = most
        found: list[str] = []
        try:
            found.extend(node.name for node, *_ in Waits(regions).found(deadline))
        except OutOfTimeError:
            told.append(found)
    assert [] in told
    assert all(name in whole_time for found in told for name in found)
