"""The last lines of a flight."""

from __future__ import annotations

import signal
from pathlib import Path
from types import SimpleNamespace

import pytest

from alula.common.record import FILE as RECORD
from alula.common.record import MISSION, RecordWriter
from alula.common.run_log import FILE, note_wait
from alula.missions.running import STANDS
from alula.report.aborts import (
    FRONT,
    NO_OWN_END,
    OPERATOR,
    SIGNAL,
    SUPERVISOR,
    ReportedAbort,
    aborted_by_signal,
    close_account,
    last_account,
    note_abort,
    read_abort,
    true_reason,
    with_dead,
)
from alula.report.deaths import Death
from alula.report.facts import RunFacts
from alula.report.files import Problems
from alula.report.summary import read_outcome
from alula.report.verdict import verdict_lines

LATER = {"detected_s": 40.5, "fallback_running_s": None, "moving_again_s": None}
MOCK = {"wall_s": 1.0, "factor": 100.0, "notes": []}


@pytest.mark.parametrize(
    ("responses", "told"),
    [
        ([("zed", "failed", 12.0), ("encoder", "failed", 40.0)], "encoder failed at 40.00 s"),
        ([("perception", "died", 40.0)], "perception died at 40.00 s"),
        ([("zed", "failed", 12.0), ("uplink", "lost", 40.0)], "uplink lost at 40.00 s"),
        ([], "sensor failed at 40.00 s"),
    ],
)
def test_what_failed_is_named(responses, told, tmp_path: Path):
    found = [{"sensor": sensor, "told": word, "t_s": t_s} for sensor, word, t_s in responses]
    summary = {"outcome": "degraded", "mock": MOCK, "answers": found, "recovery": {"failure_s": 40.0, **LATER}}
    lines = verdict_lines(summary, [], tmp_path)
    assert f"  recovery: {told}, detected 0.50 s later" in lines


OUT = Path("/runs/one")


def test_a_flight_whose_nodes_all_died_names_them_and_their_logs() -> None:
    died = [Death("uav_simulator", "exit code 1", None)]
    died += [Death("zed_depth", "exit code 1", 4.0, again_s=5.5) for _ in range(3)]
    lines = verdict_lines({"outcome": None, "mission_exit": 1, "landed": None, "collisions": None}, died, OUT)
    assert lines == [
        "",
        "the mission came to no outcome: uav_simulator, zed_depth died; /runs/one/logs has the reasons",
        "  uav_simulator died (exit code 1); it stayed dead",
        "  zed_depth died (exit code 1) at 4.0 s of mission clock; it was started again at 5.5 s of mission clock (3 times in all)",
    ]


def test_a_mission_that_could_not_start_tells_no_figures() -> None:
    summary = {"outcome": "not_started", "reason": "the mission clock stands still", "landed": None, "collisions": None}
    lines = verdict_lines(summary, [Death("uav_simulator", "exit code 1", None)], OUT)
    assert lines == [
        "",
        "the mission could not start: the mission clock stands still",
        "  uav_simulator died (exit code 1); it stayed dead",
    ]


def test_what_is_not_known_of_a_flight_is_said_so() -> None:
    of_every_robot = {"outcome": "given_up", "landed": True, "duration_s": 9.0}
    lines = verdict_lines(
        {**of_every_robot, "collisions": None, "distance_m": None, "min_clearance_m": None, "map": {"points": None}, "video": None}, [], OUT
    )
    assert lines[2:] == [
        "  landed: yes, duration 9.0 s, flown unknown, collisions unknown, nearest surface unknown",
        "  map: none",
    ]
    assert verdict_lines(of_every_robot, [], OUT)[2:] == ["  landed: yes, duration 9.0 s"], (
        "nothing is said of what a robot does not measure"
    )


def test_of_a_robot_without_a_state_of_departure_nothing_is_said_of_coming_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robot.yaml").write_text("name: arm\n")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    over_mocks = {"outcome": "accomplished", "landed": None, "duration_s": 9.0, "mock": MOCK}
    assert verdict_lines(over_mocks, [], OUT)[2] == "  duration 9.0 s; over mocks in 1.00 s, 100 times faster than the clock"
    through_a_world = {"outcome": "accomplished", "landed": None, "duration_s": 9.0, "distance_m": 4.0}
    assert verdict_lines(through_a_world, [], OUT)[2] == "  duration 9.0 s, travelled 4.0 m"


def test_what_was_done_of_what_the_mission_was_sent_out_for_is_told_with_why_not() -> None:
    tasks = [
        {"name": "a-b", "done": True, "why": ""},
        {"name": "b-c", "done": False, "why": "the door is shut"},
        {"name": "c", "done": False, "why": ""},
    ]
    lines = verdict_lines({"outcome": "degraded", "landed": True, "tasks": tasks}, [], OUT)
    assert lines[-3:] == ["  tasks: 1 of 3 done", "    b-c: not done: the door is shut", "    c: not done"]


def test_a_crash_is_no_landing() -> None:
    summary = {"outcome": "given_up", "landed": False, "crash": "it met the ground at 7.6 m/s", "duration_s": 9.0}
    assert verdict_lines(summary, [], OUT)[2].startswith("  landed: no, it crashed: it met the ground at 7.6 m/s, duration 9.0 s")


def test_a_flight_that_left_no_outcome_still_tells_what_flew() -> None:
    summary = {"outcome": None, "landed": False, "duration_s": 12.0, "distance_m": 9.0}
    lines = verdict_lines(summary, [Death("mission", "signal SIGKILL", 12.0)], OUT)
    assert lines[1] == "the mission came to no outcome: mission died; /runs/one/logs has the reasons"
    assert lines[3].startswith("  landed: no, duration 12.0 s")


def test_a_mission_that_heard_no_clock_tells_which_processes_had_died_for_good() -> None:
    for_good, again = (
        {"name": name, "when_s": 3.0, "how": "signal SIGKILL", "again_s": again_s} for name, again_s in (("a", None), ("b", 4.0))
    )
    said = "the mission clock stands still; the robot was not at rest within 30 s"
    told = "the mission clock stands still: a died (signal SIGKILL); the robot was not at rest within 30 s"
    assert with_dead(said, [for_good, again]) == told
    assert with_dead(said.replace("the mission clock stands still", STANDS), [for_good, again]) == told
    assert with_dead(said, [again]) == said
    assert with_dead("the tree raised KeyError", [for_good]) == "the tree raised KeyError"
    assert with_dead(None, [for_good]) is None


SIGINT, SIGTERM = "told to end by SIGINT", "told to end by SIGTERM"
NO_CLOCK = "the mission clock did not begin within 120 s: nothing came from ArduPilot on UDP 9002"


@pytest.mark.parametrize(
    ("outcome", "reason", "ended", "told"),
    [
        ("aborted", SIGINT, ReportedAbort(SUPERVISOR, NO_CLOCK), f"mission ended by the supervisor: {NO_CLOCK}"),
        ("aborted", SIGINT, ReportedAbort(OPERATOR, "Ctrl-C"), "mission aborted by the operator: Ctrl-C"),
        ("aborted", SIGINT, ReportedAbort(SIGNAL, "SIGTERM to alula run"), "mission aborted from outside: SIGTERM to alula run"),
        ("aborted", SIGTERM, None, "mission aborted from outside: told to end by SIGTERM"),
        ("aborted", "aborted by the operator", None, "mission aborted by the operator"),
        ("aborted", "the tree raised ValueError: x", None, "mission aborted: the tree raised ValueError: x"),
        (None, None, ReportedAbort(SUPERVISOR, "uav_simulator died"), "mission ended by the supervisor: uav_simulator died"),
        ("running", None, ReportedAbort(FRONT, "the supervisor died"), "mission ended by the front: the supervisor died"),
    ],
)
def test_whoever_ends_a_mission_is_told_by_name(
    outcome: str | None, reason: str | None, ended: ReportedAbort | None, told: str, tmp_path: Path
):
    if ended is not None:
        note_abort(tmp_path, ended)
        note_abort(tmp_path, ReportedAbort(OPERATOR, "who came later"))
    for said in (reason, true_reason(reason, ended)):  # as the mission says it, and as the summary does
        lines = verdict_lines({"outcome": outcome, "reason": said, "mission_exit": 1, "landed": None}, [], tmp_path)
        assert lines == ["", told]


def test_a_mission_that_had_come_to_its_end_keeps_its_outcome(tmp_path: Path) -> None:
    note_abort(tmp_path, ReportedAbort(OPERATOR, "Ctrl-C"))
    lines = verdict_lines({"outcome": "accomplished", "landed": None}, [], tmp_path)
    assert lines == ["", "mission accomplished", "  the run was aborted by the operator: Ctrl-C"]


def test_how_a_robot_is_left_is_told_with_whether_it_came_back() -> None:
    summary = {"outcome": "given_up", "landed": False, "left": "still in the air, in BRAKE, at 3.0 m", "duration_s": 9.0}
    assert verdict_lines(summary, [], OUT)[2] == "  landed: no, still in the air, in BRAKE, at 3.0 m, duration 9.0 s"


def test_what_a_run_still_waited_for_at_its_end_is_told(tmp_path: Path) -> None:
    for what, over in (("ArduPilot on UDP 9002", False), ("the autopilot", False), ("the autopilot", True)):
        note_wait(tmp_path, what, over=over)
    with (tmp_path / FILE).open("a", encoding="utf-8") as file:
        file.write('{"kind": "wait", "for": "cut')
    lines = verdict_lines({"outcome": "not_started", "reason": "the mission clock stands still", "landed": None}, [], tmp_path)
    assert lines[1:] == ["the mission could not start: the mission clock stands still", "  it still waited for ArduPilot on UDP 9002"]


def test_a_folder_that_is_gone_or_holds_nonsense_ends_nothing_else(tmp_path: Path) -> None:
    note_abort(tmp_path / "gone", ReportedAbort(OPERATOR, "Ctrl-C"))
    assert read_abort(tmp_path / "gone") is None
    for nonsense in ("", "[]", '{"kind": "end", "by": 1}', '{"kind": "end", "who": "x"}'):
        (tmp_path / FILE).write_text(nonsense, encoding="utf-8")
        assert read_abort(tmp_path) is None


def test_a_signal_to_the_command_is_the_operators_when_it_is_ctrl_c() -> None:
    assert aborted_by_signal(signal.SIGINT) == ReportedAbort(OPERATOR, "Ctrl-C")
    assert aborted_by_signal(signal.SIGHUP) == ReportedAbort(SIGNAL, "SIGHUP to alula run")


def test_an_outcome_is_told_with_its_reason() -> None:
    summary = {"outcome": "given_up", "reason": "no sensor left", "landed": True}
    assert verdict_lines(summary, [], OUT)[1] == "mission given up: no sensor left"


def test_the_summary_of_a_run_that_came_to_its_limit_says_so(tmp_path: Path) -> None:
    note_abort(tmp_path, ReportedAbort(SUPERVISOR, "its limit of 30 s is over"))
    facts = RunFacts("mapping", 1, tmp_path, (), (), 1)
    history = SimpleNamespace(mission={"outcome": "aborted", "reason": SIGINT})
    assert read_outcome(facts, history, Problems()) == ("aborted", "ended by the supervisor: its limit of 30 s is over")


KILLED = ReportedAbort(SUPERVISOR, "mission died (signal SIGKILL)", 30.0)
UNHEARD = ReportedAbort(SUPERVISOR, "ros_bridge died (exit code 1) and stayed dead", 41.0)


@pytest.mark.parametrize("damage", [b"", b"\x05cut"])
@pytest.mark.parametrize(
    ("ended", "code", "reason", "told"),
    [
        (KILLED, 1, KILLED.sentence(), "mission ended by the supervisor: mission died (signal SIGKILL)"),
        (UNHEARD, 1, UNHEARD.sentence(), "mission ended by the supervisor: ros_bridge died (exit code 1) and stayed dead"),
        (ReportedAbort(OPERATOR, "Ctrl-C"), 1, "aborted by the operator: Ctrl-C", "mission aborted by the operator: Ctrl-C"),
        (
            None,
            1,
            "the mission's process ended with exit code 1 before the mission did",
            "mission aborted: the mission's process ended with exit code 1 before the mission did",
        ),
    ],
)
def test_a_mission_that_could_not_tell_its_end_was_aborted_by_whoever_ended_it(
    ended: ReportedAbort | None, code: int, reason: str, told: str, damage: bytes, tmp_path: Path
) -> None:
    RecordWriter(tmp_path / RECORD).write(MISSION, 0, {"outcome": "running", "reason": "", "lift_off_s": None, "joined": {"base": 8}})
    with (tmp_path / RECORD).open("ab") as file:
        file.write(damage)
    if ended is not None:
        note_abort(tmp_path, ended)
    for _ in range(2):
        close_account(tmp_path, code)
        account = last_account(tmp_path)
        assert account == {"outcome": "aborted", "reason": reason, "joined": {"base": 8}, "problems": [NO_OWN_END]}
    problems = Problems()
    outcome, said = read_outcome(RunFacts("mapping", 1, tmp_path, (), (), code), SimpleNamespace(mission=account), problems)
    assert (outcome, said, problems.sentences) == ("aborted", reason, [NO_OWN_END])
    assert verdict_lines({"outcome": outcome, "reason": said, "mission_exit": code, "landed": None}, [], tmp_path) == ["", told]


@pytest.mark.parametrize(("account", "code"), [({"outcome": "given_up", "reason": "x"}, 1), ({"outcome": "running"}, 0), ({}, 1)])
def test_the_account_of_a_mission_that_had_come_to_its_end_stays(account: dict[str, str], code: int, tmp_path: Path) -> None:
    if account:
        RecordWriter(tmp_path / RECORD).write(MISSION, 0, account)
    note_abort(tmp_path, KILLED)
    close_account(tmp_path, code)
    assert last_account(tmp_path) == account
