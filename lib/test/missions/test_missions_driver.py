"""What drives the director in every host: when it ticks, what it obeys, what it writes down."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

pytest.importorskip("py_trees")

from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from alula.common.record import EVENTS, MISSION, OPERATOR, TICKS, TREE, read_record
from alula.missions.conditions import Condition
from alula.missions.context import MissionContext
from alula.missions.director import MissionResult, Outcome
from alula.missions.driver import MissionDriver
from alula.missions.pausing import PauseRefusedError
from alula.missions.pending import PendingInterrupts
from alula.missions.plan import InputError, MissionPlan
from alula.missions.record import MissionRecord
from alula.runtime.core.events import TransitionEvent


class Clock:
    def __init__(self) -> None:
        self.now_ns = 1_000_000_000

    def ns(self) -> int:
        return self.now_ns


class Tree:
    """A mission that goes on until the test has it end or break; what is in ``raises`` raises, and ``stops`` tells how it is stopped."""

    degraded = False

    def __init__(self) -> None:
        self.status, self.broken, self.ready = Status.RUNNING, False, True
        self.raises: set[str] = set()
        self.stops: list[Stop] = []
        self.root: Behaviour = Root(self)

    @property
    def stopping(self) -> bool:
        self.may_raise("stopping")
        return False

    def conditions(self) -> list:
        self.may_raise("conditions")
        return [Condition("the robot is ready", "" if self.ready else "it is not")]

    def stop_here(self) -> Behaviour:
        self.may_raise("stop_here")
        self.stops.append(Stop())
        return self.stops[-1]

    def facts(self) -> dict:
        self.may_raise("facts")
        return {}

    def may_raise(self, what: str) -> None:
        if what in self.raises:
            raise ZeroDivisionError(f"no {what}")


class Stop(Behaviour):
    """Takes three ticks to bring the robot to rest."""

    def __init__(self) -> None:
        super().__init__("stop_here")
        self.ticks = 0

    def update(self) -> Status:
        self.ticks += 1
        return Status.RUNNING if self.ticks < 3 else Status.SUCCESS


class Unwritable:
    """What nobody can make text of."""

    def __str__(self) -> str:
        raise ZeroDivisionError("no text")


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

    def __init__(self, out: Path, *, recorded: bool = True, joins: bool = False) -> None:
        self.clock, self.tree, self.jobs, self.said = Clock(), Tree(), list[Callable[[], None]](), list[str]()
        self.out = out
        self.entries: dict[str, object] = {}

        def make(_clients: Mapping, _clock: object, _values: Mapping) -> tuple[Tree, MissionContext]:
            pending = PendingInterrupts(self.clock.ns)
            return self.tree, MissionContext(clock_ns=self.clock.ns, pending=pending, entries=lambda: self.entries)

        plan = MissionPlan("patrol", (), make, facts=self.tree.facts)
        record = MissionRecord(out, plan, self.clock.ns, {}, joins=joins) if recorded else None
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


@pytest.mark.parametrize("joins", [True, False])
def test_what_happened_before_a_mission_is_not_its_own_where_it_joins_managers_that_run(tmp_path: Path, *, joins: bool) -> None:
    host = Host(tmp_path, joins=joins)
    host.clock.now_ns += 10
    for number in (7, 8, 9):  # the client is told of the first two after the mission has begun: they are history
        stamp_ns = host.clock.now_ns - (20 if number < 9 else 0)
        host.driver.event(TransitionEvent(number, stamp_ns, "wheels", "FREE", "USED", "extern", skillset="base"))
    host.work()
    killed = host.written(MISSION)[-1]
    host.driver.finish(MissionResult(Outcome.ACCOMPLISHED))
    assert (killed["outcome"], killed.get("joined")) == ("running", {"base": 8} if joins else None)
    assert [event["sequence"] for event in host.written(EVENTS)] == ([9] if joins else [7, 8, 9])
    assert host.written(MISSION)[-1].get("joined") == ({"base": 8} if joins else None)
    assert len(host.written(TICKS)) == 1


def test_what_happened_before_the_clock_was_set_back_is_not_the_missions_own(tmp_path: Path) -> None:
    host = Host(tmp_path, joins=True)
    hour_ns = 3600 * 10**9
    host.clock.now_ns += 10
    stamps_ns = [host.clock.now_ns - 20, host.clock.now_ns + hour_ns, host.clock.now_ns]
    for number, stamp_ns in enumerate([*stamps_ns, host.clock.now_ns + hour_ns], start=7):  # the last one came just when it was set again
        host.driver.event(TransitionEvent(number, stamp_ns, "wheels", "FREE", "USED", "extern", skillset="base"))
    host.driver.finish(MissionResult(Outcome.ACCOMPLISHED))
    assert [event["sequence"] for event in host.written(EVENTS)] == [9, 10]
    assert host.written(MISSION)[-1].get("joined") == {"base": 8}


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
    for _ in range(6):
        host.wake()
    assert host.driver.end is not None
    assert (host.driver.end.outcome, host.driver.end.reason) == (Outcome.ABORTED, "the tree raised ZeroDivisionError: no such way")
    assert host.said == ["the tree raised ZeroDivisionError: no such way"]


def test_a_signals_abort_is_obeyed_by_the_next_tick_and_written_before_it(host: Host) -> None:
    host.wake()
    host.driver.ask_abort("told to end by SIGINT")
    assert host.written(OPERATOR) == []
    for _ in range(6):
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


# --- whatever raises -----------------------------------------------------------------------------------------------------


def spoil_root(host: Host) -> None:
    host.tree.broken = True


def spoil_entry(host: Host) -> None:
    host.entries["odd"] = Unwritable()


def spoil_message(host: Host) -> None:
    host.tree.root.feedback_message = Unwritable()


def spoil_event(host: Host) -> None:
    host.driver.event(TransitionEvent(1, host.clock.now_ns, "wheels", Unwritable(), "USED", "extern"))  # type: ignore[arg-type]


def spoil_page(host: Host) -> None:
    host.driver.show(lambda: host.tree.may_raise("page"))


def raising(name: str) -> Callable[[Host], None]:
    return lambda host: host.tree.raises.add(name)


SPOILS = {
    "root": spoil_root,
    "entry": spoil_entry,
    "message": spoil_message,
    "event": spoil_event,
    "page": spoil_page,
    "stopping": raising("stopping"),
    "stop_here": raising("stop_here"),
    "facts": raising("facts"),
    "conditions": raising("conditions"),
}
ASK_ONLY_AT_THE_END = {"stopping", "stop_here", "facts"}


def ended(host: Host) -> MissionResult:
    for _ in range(10):
        host.wake()
    assert host.driver.end is not None
    host.driver.finish(host.driver.end)
    return host.driver.end


@pytest.mark.parametrize(
    ("what", "recorded"), [*((what, True) for what in ("root", "entry", "message", "event", "page")), ("root", False), ("page", False)]
)
def test_whatever_is_raised_under_way_ends_aborted_with_the_robot_at_rest(what: str, recorded: bool, tmp_path: Path) -> None:  # noqa: FBT001
    host = Host(tmp_path, recorded=recorded)
    host.wake()
    host.wake()
    host.tree.raises.add("page")
    SPOILS[what](host)
    assert ended(host).outcome is Outcome.ABORTED
    assert [stop.ticks for stop in host.tree.stops] == [3]
    assert len(host.said) == 1, "told once, however often it is raised"
    if recorded:
        assert host.written(MISSION)[-1]["outcome"] == "aborted"


@pytest.mark.parametrize("recorded", [True, False])
def test_what_is_raised_before_the_start_is_a_mission_that_could_not_start(recorded: bool, tmp_path: Path) -> None:  # noqa: FBT001
    host = Host(tmp_path, recorded=recorded)
    host.tree.raises.add("conditions")
    end = ended(host)
    assert (end.outcome, end.reason) == (Outcome.NOT_STARTED, "the tree raised ZeroDivisionError: no conditions")
    assert host.tree.stops == []
    if recorded:
        assert host.written(TICKS) == [{"unmet": []}]
        assert host.written(MISSION)[-1]["outcome"] == "not_started"


def test_a_record_that_fails_before_the_start_keeps_the_mission_from_it(host: Host) -> None:
    host.tree.ready = False
    host.wake()
    spoil_entry(host)
    assert ended(host).outcome is Outcome.NOT_STARTED
    assert host.tree.stops == []


@pytest.mark.parametrize("what", sorted(ASK_ONLY_AT_THE_END))
def test_an_abort_ends_whatever_raises_on_the_way(what: str, host: Host) -> None:
    host.wake()
    host.wake()
    SPOILS[what](host)
    host.driver.abort("aborted by the operator")
    end = ended(host)
    assert end.outcome is Outcome.ABORTED
    assert end.reason.startswith("aborted by the operator")
    assert [stop.ticks for stop in host.tree.stops] == ([] if what == "stop_here" else [3])
    assert host.written(MISSION)[-1]["reason"] == end.reason


@given(spoils=st.lists(st.tuples(st.integers(0, 8), st.sampled_from(sorted(SPOILS))), max_size=4), abort_at=st.integers(0, 8))
def test_a_mission_ends_and_is_told_whatever_raises_when(spoils: list[tuple[int, str]], abort_at: int, tmp_path_factory) -> None:
    host = Host(tmp_path_factory.mktemp("run"))
    started = False
    for tick in range(9):
        for _, what in (one for one in spoils if one[0] == tick):
            SPOILS[what](host)
        if tick == abort_at:
            host.driver.abort("told to end")
        host.wake()
        started = started or host.driver.director.start_s is not None
    end = ended(host)
    assert (end.outcome is Outcome.NOT_STARTED or end.reason == "told to end") or started
    assert started or host.tree.stops == []
    assert len(host.tree.stops) <= 1
    assert host.written(MISSION)[-1]["outcome"] == end.outcome.value
    assert host.written(EVENTS) == []


def test_a_mission_that_can_not_be_made_is_refused_in_a_line(tmp_path: Path) -> None:
    def make(*_: object) -> tuple[Tree, MissionContext]:
        raise ZeroDivisionError("no such node")

    with pytest.raises(InputError, match="the mission can't be made: ZeroDivisionError: no such node"):
        MissionDriver(MissionPlan("patrol", (), make), lambda _name, _wake: None, Clock().ns, {})  # type: ignore[arg-type,return-value]
    assert not list(tmp_path.iterdir())
