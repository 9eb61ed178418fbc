"""Entries that decide nothing any more are forgotten, and none else: held against the search that forgets nothing."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

pytest.importorskip("z3")

from test_prove_mission_runs import ROOT, everything, robots, shown

from alula.check.robot import models_of, part_of
from alula.common.robots import find_robot
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART
from alula.prove.limits import Deadline
from alula.prove.mission.ahead import Looking
from alula.prove.mission.managers import Failures
from alula.prove.mission.prover import prove_mission
from alula.prove.mission.regions import Regions
from alula.prove.mission.system import System
from finding_pages.mission_checks import whole

QUIET = Failures(hooks=False, refusals=False, aborts=False)
LEAVES = (
    '<drone.hover outcome="{a}"/>',
    '<drone.lift outcome="{b}"/>',
    '<drone.land outcome="{a}"/>',
    '<eyes.watch outcome="{b}"/>',
    "<Script code=\"a := ''\"/>",
    '<Script code="b := a"/>',
    "<Script code=\"a := b == 'DONE' ? 'x' : b; b := 'x'\"/>",
    "<Script code=\"a == 'x' ? b := 'x' : b := ''\"/>",
    "<ScriptCondition code=\"a == 'DONE' || a == 'ABORTED'\"/>",
    "<ScriptCondition code=\"a == 'DONE' || b == 'x'\"/>",
    "<ScriptCondition code=\"b != 'ours'\"/>",
    '<ScriptCondition code="a == b"/>',
    "<WaitFor if=\"b == 'x' || b == 'INTERRUPTED'\"/>",
    '<SubTree ID="inner" own="{a}"/>',
    '<SubTree ID="inner" own="x" _autoremap="true"/>',
    '<Sleep msec="250"/>',
    '<WaitFor if="running(drone.hover)"/>',
)
ABOVE = (
    "Sequence",
    "Fallback",
    "SequenceWithMemory",
    "AsyncSequence",
    'Parallel success_count="1" failure_count="1"',
    'Parallel success_count="2" failure_count="2"',
    "ParallelAll",
    "ReactiveFallback",
)
ROUND = (
    "ForceSuccess",
    "Inverter",
    'RetryAfter attempts="3" wait="0.2" if="a == \'ABORTED\'"',
    "Until if=\"b == 'x' || a == 'x'\"",
    'Repeat num_cycles="2"',
    'RetryUntilSuccessful num_attempts="2"',
    'Timeout msec="300"',
    'Delay delay_msec="200"',
    "KeepRunningUntilFailure",
    'Precondition if="b == \'x\'" else="FAILURE"',
    'WaitValueUpdate entry="{a}"',
    'LoopString queue="x;y" value="{b}"',
    "RunOnce",
    'Sequence _onSuccess="a := \'x\'" _onFailure="b := a"',
)
INNER = """
  <BehaviorTree ID="inner">
    <Fallback>
      <Sequence><drone.hover outcome="{own}"/><ScriptCondition code="own == 'DONE'"/></Sequence>
      <ScriptCondition code="@b == 'x'"/>
    </Fallback>
  </BehaviorTree>
</root>"""
ONCE = '<ForceSuccess><drone.hover outcome="{a}"/></ForceSuccess>'


def tree(chance: random.Random, depth: int) -> str:
    if depth == 0:
        return chance.choice(LEAVES)
    if chance.random() < 0.4:
        tag = chance.choice(ROUND)
        return f"<{tag}>{tree(chance, depth - 1)}</{tag.split()[0]}>"
    tag = chance.choice(ABOVE)
    return f"<{tag}>{''.join(tree(chance, depth - 1) for _ in range(2))}</{tag.split()[0]}>"


def written(folder: Path, inside: str) -> Path:
    path = folder / "mission.xml"
    text = whole(f"<Sequence><Script code=\"a := ''; b := ''\"/>{inside}</Sequence>")
    path.write_text(text.replace("</root>", INNER).replace("<root", '<root main_tree_to_execute="mission"'))
    return path


@pytest.mark.parametrize("seed", range(60))
def test_an_entry_that_is_forgotten_decides_nothing(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    chance = random.Random(seed)  # noqa: S311 - for tests
    path = written(tmp_path, f"{ONCE}{tree(chance, 3)}{tree(chance, 2)}")
    short = shown(path, QUIET)
    monkeypatch.setattr(Looking, "ahead", everything)
    kept = shown(path, QUIET)
    if kept is None:
        pytest.skip("too many situations without what is forgotten")
    assert short == kept


@pytest.mark.parametrize("count", ["-2", "0", "1", "-1"])
@pytest.mark.parametrize("node", ["Repeat num_cycles", "RetryUntilSuccessful num_attempts", 'RetryAfter if="1" attempts'])
def test_what_a_child_writes_that_may_not_be_ticked_is_remembered(
    node: str, count: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tag = node.split(maxsplit=1)[0]
    again = f'<ForceSuccess><{node}="{count}"><Sequence><Script code="a := \'x\'"/><drone.lift/></Sequence></{tag}></ForceSuccess>'
    asked = "<Fallback><ScriptCondition code=\"a == 'x' || a == 'DONE'\"/><drone.land/></Fallback>"
    path = written(tmp_path, f"{ONCE}{again}{asked}")
    short = shown(path, QUIET)
    monkeypatch.setattr(Looking, "ahead", everything)
    assert short == shown(path, QUIET) is not None


def memories(folder: Path, inside: str) -> int:
    regions = Regions(System.of(MissionFile.read(written(folder, inside), robots(), NO_PART), QUIET), Deadline.after(1e6))
    regions.explore()
    return len(regions.system.ticker.memories)


def test_an_entry_that_is_written_before_it_is_read_costs_nothing(tmp_path: Path) -> None:
    asks = "<ForceSuccess><ScriptCondition code=\"a != 'ABORTED'\"/></ForceSuccess>"
    in_rounds = f'<Until if="b == \'x\'"><Sequence>{{}}{asks}<Sleep msec="100"/></Sequence></Until>'
    kept, forgotten = (memories(tmp_path, in_rounds.format(one)) for one in (ONCE.replace("{a}", "{c}"), ONCE))
    assert forgotten == kept


def test_texts_that_nothing_tells_apart_are_one(tmp_path: Path) -> None:
    either = "<ScriptCondition code=\"a == 'DONE' || a == 'ABORTED'\"/>"
    each = "<Fallback><ScriptCondition code=\"a == 'DONE'\"/><ScriptCondition code=\"a == 'ABORTED'\"/></Fallback>"
    one, several = (memories(tmp_path, f'{ONCE}<Sleep msec="100"/>{asked}') for asked in (either, each))
    assert one < several


def test_what_was_halted_costs_a_sum_and_no_product(tmp_path: Path) -> None:
    """Executions that are still to end are the managers' business: the tree does not remember them."""
    inside = """<ForceSuccess><Parallel success_count="1" failure_count="1">
      <Sequence><drone.hover/><AlwaysFailure/></Sequence><eyes.watch/></Parallel></ForceSuccess><Sleep msec="100"/><Sleep msec="100"/>"""
    one = inside.replace("<eyes.watch/>", '<WaitFor if="false"/>')
    assert memories(tmp_path, inside) <= memories(tmp_path, one) + 2


def test_all_runs_of_a_mission_of_two_robots_are_looked_at() -> None:
    path = ROOT / "examples" / "two_robots" / "missions" / "meet.xml"
    robot = find_robot(path.parent)
    proved = prove_mission(MissionFile.read(path, models_of(robot, print), part_of(robot, print)), timeout_s=1e6)
    assert proved.complete
    assert not proved.findings
