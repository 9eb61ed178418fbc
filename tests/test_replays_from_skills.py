"""Replays of recorded missions by the tree alone: the same decisions again, and what one change does to them."""

from __future__ import annotations

import json
import os
import random
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer

import alula.cli.replay
from alula.cli import expect
from alula.cli import run as over_mocks
from alula.cli.replay import CANNOT_REPLAY, OTHERWISE, SAME
from alula.common.faults import parse_fault
from alula.common.record import DATA, DECISIONS, EVENTS, FILE, MISSION, Entry, RecordWriter, read_record
from alula.common.scenarios import load_scenario
from alula.missions.director import Outcome
from alula.missions.mocked import MockedMission
from alula.missions.scenario import plan_of
from alula.mock import MockSkill, load_behaviour
from alula.records.models import robot_skillsets
from alula_flight.replay import main
from uav_missions.route import inputs_of

ALULA_ROOT = Path(os.environ["ALULA_ROOT"])


@pytest.fixture(autouse=True)
def without_report(monkeypatch):
    """Make no report of a replay: seconds each; ``test_replay_outputs`` has those that are made."""
    monkeypatch.setattr(alula.cli.replay, "make_report", lambda *_: None)


def fly(out: Path, *faults: str, scenario: str = "mapping") -> Path:
    """Fly over mocks and return the run's folder."""
    words = [scenario, "--mock", "--out", str(out), *(word for fault in faults for word in ("--fail", fault))]
    mission, _ = over_mocks.prepare(over_mocks.parse(words))
    mission.run()
    over_mocks.note_account(out, mission, [parse_fault(fault) for fault in faults])
    return out


def requests(run: Path) -> list[tuple]:
    """Return what a recorded tree asked for, in order, without ids and times."""
    found = [entry.value for entry in read_record(run) if entry.topic == DECISIONS]
    return [(value["kind"], value["skillset"], value["skill"], value["inputs"]) for value in found]


def ending(run: Path) -> tuple[str, str]:
    """Return outcome and reason."""
    mission = [entry.value for entry in read_record(run) if entry.topic == MISSION][-1]
    return mission["outcome"], mission["reason"]


@pytest.fixture(scope="module")
def nominal(tmp_path_factory) -> Path:
    return fly(tmp_path_factory.mktemp("nominal") / "run")


@pytest.fixture(scope="module")
def zed_dead(tmp_path_factory) -> Path:
    return fly(tmp_path_factory.mktemp("zed") / "run", "zed@20")


@pytest.mark.parametrize(
    ("scenario", "faults"),
    [
        ("mapping", ["zed@8", "lidar@8"]),
        ("mapping", ["pilot@12"]),
        ("inspection", ["lidar@9"]),
    ],
)
def test_a_flight_is_decided_as_it_was(tmp_path, capsys, scenario, faults):
    run = fly(tmp_path / "run", *faults, scenario=scenario)
    assert main([str(run), "--out", str(tmp_path / "again")]) == SAME
    assert f"{len(requests(run))} decisions, all as they were" in capsys.readouterr().err
    assert requests(tmp_path / "again") == requests(run)
    assert ending(tmp_path / "again") == ending(run)


def test_a_replay_is_a_record_that_replays(zed_dead, tmp_path):
    assert main([str(zed_dead), "--out", str(tmp_path / "again")]) == SAME
    assert main([str(tmp_path / "again")]) == SAME


def mapping_over_mocks(out: Path) -> MockedMission:
    """Return a mission that is to be told something on the way."""
    inputs = inputs_of(ALULA_ROOT / "ros1_ws/src/uav_simulator/worlds/yard.yaml")
    skillsets = robot_skillsets(("navigation", "perception", "mapping"))
    behaviour = load_behaviour([ALULA_ROOT / "skillsets/uav/mock.yaml"], robot_skillsets())
    out.mkdir()
    return MockedMission(
        skillsets, behaviour.of(frozenset(s.name for s in skillsets)), plan_of(load_scenario("mapping"), inputs, skillsets), out=out
    )


def pause_between(mission: MockedMission, *, pause_s: float, resume_s: float) -> None:
    """Have the operator pause a mission and let it go on, seconds of its clock from now."""

    def tell(command: str, act: Callable[[], object]) -> None:
        mission._record.told(command, "")
        act()

    mission.world.clock.after(pause_s, lambda: tell("pause", mission.director.pause))
    mission.world.clock.after(resume_s, lambda: tell("resume", mission.director.resume))


def test_a_pause_is_decided_as_it_was(tmp_path):
    mission = mapping_over_mocks(tmp_path / "run")
    pause_between(mission, pause_s=15.0, resume_s=75.0)
    assert mission.run().outcome is Outcome.ACCOMPLISHED
    asked = [(kind, skill) for kind, _, skill, _ in requests(tmp_path / "run") if kind in {"pause", "resume"}]
    assert asked.count(("pause", "zed_depthmap")) == 3  # no mock can hold
    assert asked.count(("resume", "zed_depthmap")) == 1
    assert ("resume", "goto_straight") not in asked  # it has ended meanwhile
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "again")]) == SAME
    assert requests(tmp_path / "again") == requests(tmp_path / "run")
    assert ending(tmp_path / "again") == ending(tmp_path / "run")


def test_skills_hold_in_a_replay_where_they_held_then(tmp_path, monkeypatch):
    mission = mapping_over_mocks(tmp_path / "run")
    monkeypatch.setattr(MockSkill, "on_pause", lambda _self, execution: "" if execution.skill == "goto_straight" else "no")
    monkeypatch.setattr(MockSkill, "on_resume", lambda _self, _execution: "")
    pause_between(mission, pause_s=15.0, resume_s=18.0)
    assert mission.run().outcome is Outcome.ACCOMPLISHED
    asked = [(kind, skill) for kind, _, skill, _ in requests(tmp_path / "run") if kind in {"pause", "resume"}]
    assert (asked.count(("pause", "goto_straight")), asked.count(("resume", "goto_straight"))) == (1, 1)
    monkeypatch.undo()
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "again")]) == SAME
    assert requests(tmp_path / "again") == requests(tmp_path / "run")


def test_an_abort_is_decided_as_it_was(tmp_path):
    mission = mapping_over_mocks(tmp_path / "run")
    mission.world.clock.after(15.0, lambda: mission.abort("told to end"))
    assert mission.run().outcome is Outcome.ABORTED
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "again")]) == SAME
    assert requests(tmp_path / "again") == requests(tmp_path / "run")
    assert ending(tmp_path / "again") == ("aborted", "told to end")


def test_ten_replays_are_one(capsys):
    recording = ALULA_ROOT / "tests/recordings/mapping-zed"
    traces = set()
    for rate in (0.0, 1e6) * 5:
        assert main([str(recording / FILE), "--json", "--rate", str(rate)]) == SAME
        traces.add(capsys.readouterr().out)
    (trace,) = traces
    assert [json.loads(line)["number"] for line in trace.splitlines()] == list(range(1, len(requests(recording)) + 1))


def test_a_failure_that_did_not_happen_is_decided_as_one_that_did(nominal, zed_dead, tmp_path, capsys):
    assert main([str(nominal), "--fail", "zed@20", "--on", "--out", str(tmp_path / "changed")]) == OTHERWISE
    assert requests(tmp_path / "changed") == requests(zed_dead)
    assert ending(tmp_path / "changed") == ending(zed_dead)
    said = capsys.readouterr().err
    assert "resource perception.zed_status: then 'OK', now 'BROKEN'" in said
    assert "outcome then: accomplished, now: degraded" in said
    difference = json.loads((tmp_path / "changed/replay.json").read_text())["difference"]
    assert (difference["now"]["kind"], difference["now"]["skill"]) == ("interrupt", "goto_straight")
    assert "ZED navigation" in difference["knew_now"]["path"]


def test_without_on_it_stops_at_the_first_difference(nominal, capsys):
    assert main([str(nominal), "--fail", "zed@20"]) == OTHERWISE
    told = capsys.readouterr()
    assert "now: stopped there" in told.err
    assert told.out.splitlines()[-1].endswith("interrupt navigation.goto_straight")


def test_the_lost_radio_ends_an_inspection_as_it_does_in_flight(tmp_path):
    run, failed = fly(tmp_path / "run", scenario="inspection"), fly(tmp_path / "failed", "radio@20", scenario="inspection")
    assert main([str(run), "--fail", "radio@20", "--on", "--out", str(tmp_path / "changed")]) == OTHERWISE
    assert requests(tmp_path / "changed") == requests(failed)
    assert ending(tmp_path / "changed") == ending(failed)


def test_expectations_of_a_replay_hold_for_the_next_and_not_for_another(nominal, tmp_path, capsys):
    assert main([str(nominal), "--out", str(tmp_path / "again")]) == SAME
    capsys.readouterr()
    assert expect.main([str(tmp_path / "again")]) == 0
    file = tmp_path / "nominal.yaml"
    file.write_text(capsys.readouterr().out)
    assert main([str(nominal), "--expect", str(file)]) == SAME, capsys.readouterr().err
    capsys.readouterr()
    assert main([str(nominal), "--expect", str(file), "--fail", "zed@20", "--on", "--junit", str(tmp_path / "junit.xml")]) == OTHERWISE
    said = capsys.readouterr().err
    assert "nominal.yaml:" in said
    assert "expectations fulfilled" in said
    assert "<failure" in (tmp_path / "junit.xml").read_text()


def test_another_parameter_is_another_input(nominal, capsys):
    assert main([str(nominal), "--set", "speed_m_s=0.5"]) == OTHERWISE
    assert "input speed" in capsys.readouterr().err


def test_a_record_that_breaks_off_is_replayed_up_to_there(zed_dead, tmp_path, capsys):
    whole = (zed_dead / FILE).read_bytes()
    every = requests(zed_dead)
    chance = random.Random(1)  # noqa: S311 - no secret
    for _ in range(5):
        cut = tmp_path / FILE
        cut.write_bytes(whole[: chance.randrange(4000, len(whole) - 1000)])
        recorded = requests(cut)
        assert main([str(cut), "--json"]) == SAME
        told = capsys.readouterr()
        assert [json.loads(line)["skill"] for line in told.out.splitlines()][: len(recorded)] == [skill for _, _, skill, _ in recorded]
        assert recorded == every[: len(recorded)]
        assert "the record breaks off" in told.err


def write_foreign(path: Path) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/chatter", "cdr", 0)
        writer.add_message(channel, 1, b"\x00\x01\x00\x00", 1)
        writer.finish()


def write_wrong_mission(path: Path) -> None:
    writer = RecordWriter(path)
    writer.write(MISSION, 0, {"scenario": "mapping", "route": [[0, 0, 3]]})
    writer.write(DECISIONS, 0, {"number": "one"})
    writer.close()


WRONG_MISSIONS = {
    "waypoint 2 is 'x', not [x, y, z] in metres": {"route": [[0, 0, 3], "x"]},
    "the inputs of its mission are no mapping": {"inputs": [1]},
    "its parameters are no mapping": {"parameters": [1]},
    "the parameter speed_m_s is no number, but 'fast'": {"parameters": {"speed_m_s": "fast"}},
    "the parameter speed_m_s is no number, but {}": {"parameters": {"speed_m_s": {}}},
}


@pytest.mark.parametrize("complaint", WRONG_MISSIONS)
def test_a_mission_with_values_that_can_not_be_is_refused_in_a_line(complaint, tmp_path, capsys):
    writer = RecordWriter(tmp_path / FILE)
    writer.write(MISSION, 0, {"scenario": "mapping", "route": [[0, 0, 3]], **WRONG_MISSIONS[complaint]})
    writer.close()
    assert main([str(tmp_path)]) == CANNOT_REPLAY
    said = capsys.readouterr().err
    assert f"skills.mcap: {complaint}" in said
    assert said.count("\n") == 1


def test_a_stamp_that_can_not_be_is_refused_and_not_waited_for(nominal, tmp_path, capsys):
    writer, entries = RecordWriter(tmp_path / FILE), read_record(nominal)
    for number, entry in enumerate(entries):
        writer.write(entry.topic, entry.stamp_ns + (2**60 if number == len(entries) // 2 else 0), entry.value)
    writer.close()
    assert main([str(tmp_path)]) == CANNOT_REPLAY
    said = capsys.readouterr().err
    assert "a stamp there is damaged" in said
    assert said.count("\n") == 1


def without_the_link(run: Path, folder: Path) -> Path:
    """Write the record of a run as it was before the model had the resource link, and return its folder."""
    folder.mkdir()
    writer = RecordWriter(folder / FILE)
    for entry in read_record(run):
        if entry.topic != EVENTS or entry.value.get("resource") != "link":
            writer.write(entry.topic, entry.stamp_ns, entry.value)
    writer.close()
    return folder


def test_a_resource_that_the_record_never_mentions_is_as_mocks_have_it_when_the_robot_is_ready(nominal, zed_dead, tmp_path, capsys):
    for run in (nominal, zed_dead):
        older = without_the_link(run, tmp_path / f"older_{run.parent.name}")
        assert main([str(older)]) == SAME
        assert f"{len(requests(run))} decisions, all as they were" in capsys.readouterr().err


def test_a_mission_that_never_started_for_want_of_a_resource_does_not_start_in_a_replay(tmp_path):
    fly(tmp_path / "run", "link:silent")
    assert requests(tmp_path / "run") == []
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "again")]) == SAME
    assert requests(tmp_path / "again") == []
    assert ending(tmp_path / "again") == ending(tmp_path / "run")


def test_data_that_the_model_does_not_have_are_left_out_and_noted(nominal, tmp_path):
    writer, entries = RecordWriter(tmp_path / FILE), read_record(nominal)
    unknown = Entry(DATA, entries[50].stamp_ns, {"skillset": "perception", "data": "battery", "value": 1})
    for entry in (*entries[:50], unknown, unknown, *entries[50:]):
        writer.write(entry.topic, entry.stamp_ns, entry.value)
    writer.close()
    assert main([str(tmp_path / FILE), "--out", str(tmp_path / "out")]) == SAME
    notes = json.loads((tmp_path / "out" / "replay.json").read_text())["notes"]
    assert notes == ["skillset perception has no data battery; it has zed_obstacle, lidar_obstacle"]


def write_wrong_scenario(path: Path) -> None:
    writer = RecordWriter(path)
    writer.write(MISSION, 0, {"scenario": "../secret", "route": [[0, 0, 3]]})
    writer.close()


@pytest.mark.parametrize(
    "write",
    [
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(b"#ROSBAG V2.0\n"),
        lambda path: path.write_bytes(os.urandom(5000)),
        lambda path: path.write_bytes(b"\x89MCAP0\r\n" + b"\xff" * 200),
        write_foreign,
        write_wrong_mission,
        write_wrong_scenario,
        lambda path: None,
    ],
)
def test_what_is_no_record_is_refused_in_a_line(tmp_path, capsys, write):
    write(tmp_path / FILE)
    assert main([str(tmp_path / FILE)]) == CANNOT_REPLAY
    said = capsys.readouterr().err
    assert said.startswith("alula replay: ")
    assert said.count("\n") == 1
    assert "skills.mcap" in said


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--fail", "camera@3"], "there is no fault 'camera'"),
        (["--fail", "zed@x"], "camera:dark@30-40"),
        (["--set", "sped_m_s=1"], "did you mean `speed_m_s`"),
        (["--set", "speed_m_s=fast"], "is no number"),
        (["--set", "speed_m_s=nan"], "is no finite number"),
        (["--tree", "nowhere.xml"], "nowhere.xml:1:1: can't be read: No such file or directory"),
        (["--model", "nowhere.skill"], "nowhere.skill"),
    ],
)
def test_a_wrong_request_is_told_in_a_line(nominal, capsys, words, complaint):
    assert main([str(nominal), *words]) == CANNOT_REPLAY
    said = capsys.readouterr().err
    assert complaint in said
    assert said.count("\n") == 1
