"""What drives the director in every host: when it ticks, what it obeys, what it writes down."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

pytest.importorskip("py_trees")

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success
from py_trees.common import Status

from alula.common.record import OPERATOR, TICKS, TREE, read_record
from alula.missions.blackboard import Blackboard
from alula.missions.director import Outcome
from alula.missions.driver import MissionDriver
from alula.missions.pausing import PauseRefusedError
from alula.missions.pending import PendingInterrupts
from alula.missions.plan import MissionPlan
from alula.missions.record import MissionRecord


class Clock:
    def __init__(self) -> None:
        self.now_ns = 1_000_000_000

    def ns(self) -> int:
        return self.now_ns


class Tree:
    """A mission that goes on until the test has it end or break."""

    degraded = stopping = False

    def __init__(self) -> None:
        self.status, self.broken = Status.RUNNING, False
        self.root: Behaviour = Root(self)

    def conditions(self) -> list:
        return []

    def stop_here(self) -> Behaviour:
        return Success("stands")


class Root(Behaviour):
    def __init__(self, tree: Tree) -> None:
        super().__init__("root")
        self.tree = tree

    def update(self) -> Status:
        if self.tree.broken:
            raise ZeroDivisionError("no such way")
        return self.tree.status


class Host:
    """Has jobs done when the test says so."""

    def __init__(self, out: Path) -> None:
        self.clock, self.tree, self.jobs, self.said = Clock(), Tree(), list[Callable[[], None]](), list[str]()
        self.out = out

        def make(_clients: Mapping, _clock: object, _values: Mapping) -> tuple[Tree, Blackboard]:
            return self.tree, Blackboard(clock_ns=self.clock.ns, pending=PendingInterrupts(self.clock.ns))

        plan = MissionPlan("patrol", (), make)
        record = MissionRecord(out, plan, self.clock.ns, {})
        client = lambda _name, _wake: None  # noqa: E731
        self.driver = MissionDriver(plan, client, self.clock.ns, {}, record=record, soon=self.jobs.append, say=self.said.append)

    def work(self) -> None:
        while self.jobs:
            self.jobs.pop(0)()

    def wake(self, times: int = 1) -> None:
        for _ in range(times):
            self.driver.wake()
        self.work()

    def written(self, topic: str) -> list:
        return [entry.value for entry in read_record(self.out) if entry.topic == topic]


@pytest.fixture
def host(tmp_path: Path) -> Host:
    return Host(tmp_path)


def test_several_events_at_a_moment_make_one_tick(host: Host) -> None:
    host.wake(times=3)
    host.wake()
    assert len(host.written(TICKS)) == 2
    host.driver.woken_by_events = False
    host.wake()
    assert len(host.written(TICKS)) == 2


def test_a_tree_that_raises_brings_the_robot_to_rest_and_is_told(host: Host) -> None:
    host.wake(2)
    host.tree.broken = True
    for _ in range(4):
        host.wake()
    assert host.driver.end is not None
    assert (host.driver.end.outcome, host.driver.end.reason) == (Outcome.ABORTED, "the tree raised ZeroDivisionError: no such way")
    assert host.said == ["the tree raised ZeroDivisionError: no such way"]


def test_a_signals_abort_is_obeyed_by_the_next_tick_and_written_before_it(host: Host) -> None:
    host.wake()
    host.driver.ask_abort("told to end by SIGINT")
    assert host.written(OPERATOR) == []
    for _ in range(4):
        host.wake()
    assert host.written(OPERATOR) == [{"command": "abort", "by": "mission", "reason": "told to end by SIGINT"}]
    assert host.driver.end is not None
    assert host.driver.end.outcome is Outcome.ABORTED
    ticks = len(host.written(TICKS))
    host.wake()
    assert len(host.written(TICKS)) == ticks, "nothing is ticked after the end"


def test_what_is_aborted_before_it_began_leaves_its_tree(host: Host) -> None:
    host.driver.abort("aborted by the operator")
    assert host.driver.end is not None
    assert len(host.written(TREE)) == 1


def test_a_pause_is_written_and_refused_where_it_can_not_be(host: Host) -> None:
    with pytest.raises(PauseRefusedError, match="has not started"):
        host.driver.set_paused(paused=True)
    host.wake(2)
    host.wake()
    assert "the mission is paused" in host.driver.set_paused(paused=True)
    host.work()
    assert host.driver.set_paused(paused=False) == "the mission goes on"
    assert [one["command"] for one in host.written(OPERATOR) if one["command"] != "paused"] == ["pause", "resume"]


def test_regular_ticks_end_with_the_mission(host: Host) -> None:
    waiting: list[tuple[float, Callable[[], None]]] = []
    host.driver.tick_regularly(lambda delay_s, job: waiting.append((delay_s, job)), 0.5)
    host.work()
    host.tree.status = Status.SUCCESS
    for _ in range(4):
        if waiting:
            delay_s, job = waiting.pop()
            assert delay_s == 0.5
            job()
            host.work()
    assert host.driver.end is not None
    assert host.driver.end.outcome is Outcome.ACCOMPLISHED
    assert waiting == []
