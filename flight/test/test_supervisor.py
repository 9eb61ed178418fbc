"""The supervisor's view of roslaunch's processes."""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import pytest

from alula.common.record import FILE, MISSION, RecordWriter
from alula.common.run_log import read_held
from alula.report.aborts import OPERATOR, SIGNAL, SUPERVISOR, ReportedAbort, last_account, note_abort, read_abort
from alula.report.deaths import read_deaths
from alula.report.live import LiveEvents
from alula.runtime.live.part import DEAD_S, Clock, Consequence, RunPart
from alula.runtime.live.spec import RunSpec
from alula_flight import mission_clock, rest, supervisor
from alula_flight.mission_clock import MissionClock
from alula_flight.mission_watch import SILENT_S
from alula_flight.outcome import GIVEN_UP, finish
from alula_flight.supervisor import Supervisor, Watch
from alula_flight.waits import Held


@dataclass
class StartingLaunch:
    """Stands for roslaunch while it starts: a process dies before ``start`` has returned."""

    listener: Watch
    pm: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(get_process=lambda _: SimpleNamespace(spawn_count=1)))

    def start(self) -> None:
        self.listener.process_died("simulator-2", 1)


def test_a_death_while_roslaunch_still_starts_is_noted(tmp_path: Path) -> None:
    watch = Watch(tmp_path, MissionClock(), Part())
    launch = StartingLaunch(watch)
    watch.follow(launch)
    launch.start()
    assert [death.name for death in read_deaths(tmp_path)] == ["simulator"]
    assert watch.worst is not Consequence.GO_ON


class Part(RunPart):
    """A robot with a simulator."""

    consequences: Mapping[str, Consequence] = {"simulator": Consequence.END}
    stays_dead: Mapping[str, Consequence] = {"ros_bridge": Consequence.REST}

    rested = 0
    hold: Iterator[str] = iter(())
    """What is said of who else has it, one a look; at the end nobody has."""

    def clock_source(self, spec: RunSpec) -> str:
        return "the simulator"

    def held(self, clock: Clock) -> str:
        return next(self.hold, "")

    landing: Iterator[str] = iter(())
    """What is said while it is brought to rest, one a look; it is at rest at the end."""

    def bring_to_rest(self, clock: Clock) -> None:
        self.rested += 1
        self.landed.wait()

    def resting(self, clock: Clock) -> str:
        words = next(self.landing, None)
        if words is None:
            self.landed.set()
        return words or ""

    def __init__(self) -> None:
        self.landed = threading.Event()
        self.landed.set()


class Flight:
    """A supervisor whose run has no process left: it ends as soon as it is told to."""

    def __init__(self, out: Path, scenario: str = "mapping", limit_s: float = 0.0) -> None:
        self.part = Part()
        self.supervisor = Supervisor(RunSpec(scenario, str(out), "id", limit_s=limit_s), self.part)
        self.supervisor._clock.begin(simulated=True)
        self.process = SimpleNamespace(spawn_count=1)
        self.launch = SimpleNamespace(pm=SimpleNamespace(get_process=lambda _: self.process, get_active_names=list))
        self.supervisor._watch.follow(self.launch)

    def clock(self, now_s: float) -> None:
        self.supervisor._clock._tick(SimpleNamespace(clock=SimpleNamespace(to_sec=lambda: now_s)))

    def died(self, name: str, code: int = 1) -> None:
        self.supervisor._watch.process_died(f"{name}-1", code)

    def signalled(self, number: signal.Signals) -> None:
        self.supervisor._end_asked(number)

    def ends(self) -> int:
        return self.supervisor._until_over(self.launch)


@pytest.fixture
def flight(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Flight:
    monkeypatch.setattr(supervisor, "ABORT_TIMEOUT_S", 0.0)
    monkeypatch.setattr(rest, "LOOK_S", 60.0)  # it comes to rest at once: no look is due
    return Flight(tmp_path)


def test_a_clock_that_never_begins_is_the_reason_that_is_told(flight: Flight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mission_clock, "START_TIMEOUT_S", 0.0)
    assert flight.ends() == GIVEN_UP
    assert read_abort(tmp_path) == ReportedAbort(SUPERVISOR, "the mission clock did not begin within 0 s: nothing came from the simulator")


@pytest.mark.parametrize("name", ["simulator", "master"])
def test_a_death_that_ends_a_run_is_the_reason_that_is_told(name: str, flight: Flight, tmp_path: Path) -> None:
    flight.died("driver")
    flight.died(name)
    assert flight.ends() == GIVEN_UP
    assert read_abort(tmp_path) == ReportedAbort(SUPERVISOR, f"{name} died (exit code 1)")


@pytest.mark.parametrize(("again_s", "worst"), [(None, Consequence.REST), (4.0, Consequence.GO_ON), (9.0, Consequence.GO_ON)])
def test_a_process_that_stays_dead_has_another_consequence_than_one_that_runs_again(
    again_s: float | None, worst: Consequence, flight: Flight, tmp_path: Path
) -> None:
    flight.clock(30.0)
    flight.died("ros_bridge")
    watch = flight.supervisor._watch
    for since_s in range(int(DEAD_S)):
        flight.clock(30.0 + since_s)
        if since_s == again_s:
            flight.process.spawn_count += 1
        watch.look()
        assert watch.worst is Consequence.GO_ON
    flight.clock(30.0 + DEAD_S + 0.1)
    watch.look()
    assert watch.worst is worst
    (death,) = read_deaths(tmp_path)
    assert death.again_s == (None if again_s is None else 30.0 + again_s)
    if worst is Consequence.REST:
        assert (flight.ends(), flight.part.rested) == (GIVEN_UP, 1)
        assert read_abort(tmp_path) == ReportedAbort(SUPERVISOR, "ros_bridge died (exit code 1) and stayed dead", 30.0 + DEAD_S + 0.1)


def test_a_mission_that_was_killed_is_the_reason_that_is_told(flight: Flight, tmp_path: Path) -> None:
    flight.clock(30.0)
    flight.died("mission", -signal.SIGKILL)
    assert (flight.ends(), flight.part.rested) == (GIVEN_UP, 1)
    assert read_abort(tmp_path) == ReportedAbort(SUPERVISOR, "mission died (signal SIGKILL)", 30.0)


def test_the_report_of_a_mission_that_was_killed_says_that_it_was_aborted_and_why(flight: Flight, tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    writer = RecordWriter(tmp_path / FILE)
    writer.write(MISSION, 0, {"scenario": "mapping", "outcome": "running", "reason": "", "lift_off_s": None})
    flight.clock(30.0)
    flight.died("mission", -signal.SIGKILL)
    code = finish(RunSpec("mapping", str(tmp_path), "id"), flight.ends())
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert code == GIVEN_UP
    assert (summary["outcome"], summary["reason"]) == ("aborted", "ended by the supervisor: mission died (signal SIGKILL)")
    assert last_account(tmp_path)["outcome"] == "aborted", "all that reads the account in a run's folder is told the same"


def test_a_mission_that_lives_and_is_not_heard_any_more_has_the_robot_brought_to_rest(flight: Flight, tmp_path: Path) -> None:
    flight.clock(20.0)
    flight.supervisor._mission.hear()
    flight.clock(20.0 + SILENT_S)
    assert not flight.supervisor._mission.silent
    flight.clock(20.1 + SILENT_S)
    assert (flight.ends(), flight.part.rested) == (GIVEN_UP, 1)
    assert read_abort(tmp_path) == ReportedAbort(SUPERVISOR, "the mission's process runs, and has not been heard for 30 s", 20.1 + SILENT_S)


def test_a_mission_that_was_never_heard_is_not_missed(flight: Flight) -> None:
    flight.clock(20.0)
    flight.clock(200.0)
    assert not flight.supervisor._mission.silent


def test_a_signal_from_outside_is_named(flight: Flight, tmp_path: Path) -> None:
    flight.signalled(signal.SIGTERM)
    assert flight.ends() == GIVEN_UP
    assert read_abort(tmp_path) == ReportedAbort(SIGNAL, "SIGTERM to the supervisor")


def test_what_the_operator_asked_the_front_for_is_the_operators(flight: Flight, tmp_path: Path) -> None:
    note_abort(tmp_path, ReportedAbort(OPERATOR, "Ctrl-C"))
    flight.signalled(signal.SIGINT)
    flight.ends()
    assert read_abort(tmp_path) == ReportedAbort(OPERATOR, "Ctrl-C")


def test_a_run_lasts_no_longer_than_its_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervisor, "ABORT_TIMEOUT_S", 0.0)
    flight = Flight(tmp_path, limit_s=30.0)
    for now_s in (7.0, 36.9):
        flight.clock(now_s)
        assert not flight.supervisor._over_time
    flight.clock(37.1)
    assert flight.ends() == GIVEN_UP
    assert read_abort(tmp_path) == ReportedAbort(SUPERVISOR, "its limit of 30 s is over", 37.1)


@pytest.mark.parametrize(("scenario", "rested"), [("standby", 1), ("mapping", 0)])
def test_who_only_served_its_skills_is_brought_to_rest(scenario: str, rested: int, tmp_path: Path) -> None:
    flight = Flight(tmp_path, scenario)
    flight.supervisor._watch.mission_exit = 0
    assert flight.ends() == 0
    assert flight.part.rested == rested


def test_a_front_that_has_died_is_named(flight: Flight, tmp_path: Path) -> None:
    flight.supervisor._front = 0  # no process's parent
    flight.signalled(signal.SIGTERM)  # by the kernel
    flight.ends()
    assert read_abort(tmp_path) == ReportedAbort(SUPERVISOR, "the front has died")


BRAKE = "a failsafe has it, in BRAKE"


class Hovering:
    """Somebody else has the robot: each look is two seconds of mission clock later, and after some of them something happens."""

    def __init__(self, flight: Flight, looks: int, then: Callable[[], object] = lambda: None) -> None:
        self.flight, self.looks, self.then = flight, looks, then
        self.seen = 0

    def __iter__(self) -> Iterator[str]:
        while self.seen < self.looks:
            self.seen += 1
            self.flight.clock(100.0 + 2.0 * self.seen)
            yield BRAKE
        self.then()


@pytest.mark.parametrize("code", [0, 1])
def test_a_run_goes_on_as_long_as_somebody_else_has_the_robot(code: int, flight: Flight, tmp_path: Path) -> None:
    flight.part.hold = iter(Hovering(flight, 16))
    flight.supervisor._watch.mission_exit = code
    assert flight.ends() == code
    assert flight.part.rested >= 8, "it is tried at each look, for it may be given back"
    assert read_held(tmp_path) == [f"{BRAKE}, for 10 s", f"{BRAKE}, for 20 s", f"{BRAKE}, for 30 s"]
    said: list[str] = []
    live = LiveEvents(tmp_path, said.append)
    for _ in range(2):
        live.show_new()
    assert said == [f"waiting: {how}" for how in read_held(tmp_path)], "each is said once"


@pytest.mark.parametrize(
    ("looks", "said"),
    [
        ([(0.0, "in BRAKE, at 3.0 m"), (9.9, "in BRAKE, at 3.0 m")], []),
        (
            [(0.0, "in BRAKE, at 3.0 m"), (10.0, "in BRAKE, at 3.1 m"), (11.0, "in LAND, at 3.0 m"), (20.5, "in LAND, at 1.2 m")],
            ["in BRAKE, at 3.1 m, for 10 s", "in LAND, at 1.2 m, for 20 s"],
        ),
        ([(0.0, BRAKE), (8.0, ""), (12.0, BRAKE), (21.0, BRAKE), (22.0, BRAKE)], [f"{BRAKE}, for 10 s"]),
        ([(0.0, BRAKE), (35.0, BRAKE), (36.0, BRAKE), (45.0, BRAKE)], [f"{BRAKE}, for 35 s", f"{BRAKE}, for 45 s"]),
        ([(None, BRAKE), (4.0, BRAKE), (13.0, BRAKE), (14.0, BRAKE)], [f"{BRAKE}, for 10 s"]),
    ],
    ids=["not yet", "as it is now", "given back and taken again", "after a late look", "before the clock is known"],
)
def test_what_a_run_waits_for_is_said_each_ten_seconds(looks: list[tuple[float | None, str]], said: list[str], tmp_path: Path) -> None:
    part, clock = Part(), MissionClock()
    clock.begin(simulated=True)
    part.hold = iter([words for _, words in looks])
    held = Held(RunSpec("mapping", str(tmp_path), "id"), part.held, clock)
    for now_s, words in looks:
        if now_s is not None:
            clock._tick(SimpleNamespace(clock=SimpleNamespace(to_sec=lambda now_s=now_s: now_s)))
        assert held.look() == bool(words)
    assert read_held(tmp_path) == said


def test_a_robot_that_is_brought_to_rest_is_told_of_each_ten_seconds_and_looked_after(
    flight: Flight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rest, "LOOK_S", 0.0)

    def landing() -> Iterator[str]:
        for look in range(14):
            flight.clock(100.0 + 2.0 * look)
            if look == 3:
                flight.died("driver")
            yield f"in LAND, at {14 - look} m"

    flight.part.landed.clear()
    flight.part.landing = landing()
    flight.clock(99.0)
    flight.supervisor._watch.mission_exit = 1
    assert (flight.ends(), flight.part.rested) == (1, 1)
    assert read_held(tmp_path) == ["in LAND, at 9 m, for 10 s", "in LAND, at 4 m, for 20 s"]
    flight.part.landing = iter(["in LAND, at 2 m"])
    flight.part.landed.clear()
    flight.clock(200.0)
    assert flight.ends() == 1
    assert len(read_held(tmp_path)) == 2, "another landing counts anew"


def test_a_part_that_can_not_bring_its_robot_to_rest_is_told_as_before(flight: Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_clock: Clock) -> None:
        raise RuntimeError("no guidance")

    monkeypatch.setattr(flight.part, "bring_to_rest", fails)
    flight.supervisor._watch.mission_exit = 1
    with pytest.raises(RuntimeError, match="no guidance"):
        flight.ends()


def test_who_wants_a_run_to_end_that_watches_ends_it(flight: Flight, tmp_path: Path) -> None:
    def stop() -> Iterator[str]:
        yield from Hovering(flight, 5, lambda: flight.signalled(signal.SIGTERM))
        while True:
            yield BRAKE

    flight.part.hold = stop()
    flight.supervisor._watch.mission_exit = 1
    assert flight.ends() == 1
    assert read_abort(tmp_path) == ReportedAbort(SIGNAL, "SIGTERM to the supervisor", 110.0)


def test_who_has_told_a_run_to_end_before_its_mission_ended_waits_no_longer(flight: Flight) -> None:
    flight.part.hold = iter(Hovering(flight, 1000))
    flight.signalled(signal.SIGINT)
    flight.supervisor._watch.mission_exit = 1
    assert flight.ends() == 1
    assert flight.part.rested == 1


def test_a_limit_ends_a_run_that_watches(tmp_path: Path) -> None:
    flight = Flight(tmp_path, limit_s=20.0)
    flight.clock(99.0)
    assert not flight.supervisor._over_time
    flight.part.hold = iter(Hovering(flight, 1000))
    flight.supervisor._watch.mission_exit = 1
    assert flight.ends() == 1
    end = read_abort(tmp_path)
    assert end is not None
    assert end.why == "its limit of 20 s is over"
