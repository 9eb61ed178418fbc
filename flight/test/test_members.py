"""What a fleet's command line asks of the runs of its robots, and how these are started and ended."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path

import psutil
import pytest

from alula.common.processes import RUN_ID_VARIABLE
from alula.common.robots import load_robot_folder, meaning
from alula.common.scenarios import load_scenario
from alula.report.deaths import read_deaths
from alula.runtime.live.part import RunPart
from alula.runtime.live.spec import FILE, RequestError, RunSpec
from alula_flight.command_line import parse
from alula_flight.launch import launch_arguments
from alula_flight.members import Member, Members, members_of, reports_of

FLEET = Path(__file__).resolve().parents[2] / "examples/two_robots"

ROBOT = """
import json, os, signal, sys, time
from pathlib import Path
out = Path(sys.argv[1])
out.mkdir(parents=True)
signal.signal(signal.SIGTERM, lambda *_: (out / "told").touch() or sys.exit(0))
if "refuse" in sys.argv: sys.exit("alula run: --fail: there is no zet")
(out / "run.json").touch()
time.sleep(0 if "leave" in sys.argv else 600)
"""
"""Stands for a robot's run: it has begun when it has written what it was asked for, and ends when it is told to."""


@pytest.fixture
def fleet(tmp_path):
    with meaning(load_robot_folder(FLEET)):
        yield lambda *words: parse(["meet", "--out", str(tmp_path / "run"), *words], RunPart())


def test_each_robot_gets_its_own_faults_and_options(fleet):
    spec = fleet("--fail", "drone_zed@5", "--fail", "rover_door:store@1-2", "--with", "rover:--rate=0")
    assert spec.namespace == "/two_robots"
    assert spec.members == {"drone": ["standby", "--fail=zed@5"], "rover": ["standby", "--fail=door:store@1-2", "--rate=0"]}
    arguments = launch_arguments(spec, RunPart())
    assert "use_sim_time:=True" in arguments
    assert "heartbeat:=True" in arguments
    run = RunSpec("meet", "/out", "id", seed=3, domain=7, members=spec.members)
    drone = members_of(run)._members[0]
    assert drone._command[1:5] == ["--robot", str(FLEET.parents[1]), "run", "standby"]
    assert drone._command[5:] == [
        "--fail=zed@5",
        "--commanded",
        "--namespace",
        "drone",
        "--domain",
        "7",
        "--seed",
        "3",
        "--out",
        "/out/drone",
    ]


def test_the_mission_of_robots_that_are_served_elsewhere_goes_by_the_systems_clock(fleet):
    spec = fleet("--served", "--domain", "4", "--namespace", "fleet")
    assert (spec.namespace, spec.members) == ("/fleet", {})
    arguments = launch_arguments(spec, RunPart())
    assert "use_sim_time:=False" in arguments
    assert "heartbeat:=False" in arguments


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--served"], "say in which DDS domain"),
        (["--fail", "zed@5"], "--fail zed@5: say of which robot, as drone_zed@5"),
        (["--fail", "drone_zed@x"], "--fail"),
        (["--with", "rate=0"], "needs a robot and an option of its run, as drone:--rate=0"),
    ],
)
def test_what_a_fleet_can_not_do_is_said(words, told, fleet):
    with pytest.raises(RequestError, match=told):
        fleet(*words)


def test_the_scenarios_of_the_robots_have_no_missions():
    with meaning(load_robot_folder(FLEET)):
        said = dict(load_scenario("meet").robots)
    for name, robot in load_robot_folder(FLEET).robots.items():
        assert not load_scenario(said[name], robot.scenarios).mission


def member(out: Path, name: str, *words: str) -> Member:
    (out / "logs").mkdir(exist_ok=True)
    one = Member(RunSpec("meet", str(out), "id"), name, out, [])
    one._command = [sys.executable, "-c", ROBOT, str(one.folder), *words]
    return one


def test_all_begin_before_the_mission_does_and_are_told_to_end_after_it(tmp_path):
    robots = [member(tmp_path, "one"), member(tmp_path, "two")]
    members, said = Members(tmp_path, robots), []
    assert members.begin(lambda: False) == ""
    assert all((robot.folder / FILE).exists() and robot.lives for robot in robots)
    members.end(said.append, lambda: False)
    assert said == ["the runs of one and two end"]
    assert all((robot.folder / "told").exists() and not robot.lives for robot in robots)


def test_one_that_refuses_keeps_all_from_the_mission(tmp_path):
    robots = [member(tmp_path, "one"), member(tmp_path, "two", "refuse")]
    members = Members(tmp_path, robots)
    assert members.begin(lambda: False) == "two could not be run: --fail: there is no zet"
    members.end(lambda _: None, lambda: False)
    assert not any(robot.lives for robot in robots)


def test_one_that_ends_while_the_mission_runs_is_noted_once(tmp_path):
    robot = member(tmp_path, "one", "leave")
    members = Members(tmp_path, [robot])
    assert members.begin(lambda: False) == ""
    robot.process.wait()
    members.look()
    members.look()
    assert [death.name for death in read_deaths(tmp_path)] == ["the run of one"]


def test_at_once_ends_all_processes_of_a_robots_run(tmp_path, monkeypatch):
    robot = member(tmp_path, "one")
    members = Members(tmp_path, [robot])
    monkeypatch.setenv(RUN_ID_VARIABLE, "of-the-fleet")
    assert members.begin(lambda: False) == ""
    monkeypatch.setenv(RUN_ID_VARIABLE, "of-the-robot")
    node = psutil.Popen([sys.executable, "-c", "input()"], stdin=-1)
    RunSpec("standby", str(robot.folder), "of-the-robot").save(robot.folder / FILE)
    members.end(lambda _: None, lambda: True)
    assert node.wait() == -signal.SIGKILL
    assert not robot.lives
    assert not (robot.folder / "told").exists()


def test_the_reports_of_the_robots_are_told(tmp_path):
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "summary.json").write_text(json.dumps({"outcome": "served"}), encoding="utf-8")
    spec = RunSpec("meet", str(tmp_path), "id", members={"one": [], "two": []})
    assert reports_of(spec) == [f"one: served, {tmp_path}/one/report.html", f"two: no report; {tmp_path}/logs/two.log says what it did"]
