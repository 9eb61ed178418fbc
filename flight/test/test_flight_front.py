"""What the front checks before anything starts, and how it ends what it started."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import uuid
from pathlib import Path

import psutil
import pytest

from alula.common.network import NoFreeDomainError, claim_domain, free_port
from alula.common.processes import RUN_ID_VARIABLE, end_run, processes_of_run
from alula.common.record import EVENTS, RecordWriter
from alula.common.record import FILE as RECORD
from alula.model.execution_state import ExecutionState
from alula.report.deaths import Death, read_deaths
from alula.report.live import LiveEvents, event_line
from alula.report.verdict import conformance_lines
from alula.runtime.core.events import ExecutionEvent, TransitionEvent
from alula_flight import mocked
from alula_flight.beside import page_beside
from alula_flight.command_line import parse
from alula_flight.deaths import DeathRecord, describe_exit
from alula_flight.ending import CANNOT_START
from alula_flight.fly import main, monitor_of, sensors_words
from alula_flight.mocked import MockFront, command
from alula_flight.spec import RequestError, RunSpec
from uav_simulator.world.config import find_world

ARDUPILOT = ["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--sensors", "simulated"]


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["nosuch"], ["nosuch", "mapping"]),
        (["mapping", "--fail", "nosuch"], ["nosuch", "zed", "lidar"]),
        (["mapping", "--fail", "zed@x"], ["--fail", "zed@x", "zed:dark@30-40"]),
        (["mapping", "--fail", "zed:thinned"], ["zed can't be 'thinned'", "dark"]),
        (["mapping", "--world", "nowhere"], ["--world", "'nowhere'", "yard", "forest"]),
        (["mapping", "--fail", "zed@-1"], ["zed@-1"]),
        (["mapping", "--seed", "-3"], ["--seed -3"]),
        (["mapping", "--rate", "nan"], ["--rate nan"]),
        (["mapping", "--rate", "-1"], ["--rate -1"]),
        (["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--fail", "zed@3"], ["--autopilot", "--sensors simulated"]),
        (["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--imperfections", "realistic"], ["--imperfections"]),
        (["mapping", "--sensors", "simulated"], ["--sensors", "add --autopilot"]),
        (["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--sensors", "real"], ["--sensors real", "simulated, or followed:URL"]),
        (["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--sensors", "followed:"], ["--sensors followed:", "udpin:127.0.0.1:14551"]),
        (["mapping", "--imperfections", "some"], ["--imperfections", "'some'", "realistic"]),
        (["mapping", "--autopilot=/dev/../etc/passwd"], ["--autopilot /dev/../etc/passwd", "no serial device", "tcp:HOST:PORT"]),
        (["mapping", "--autopilot=/dev/nosuch"], ["/dev/nosuch", "no such device"]),
        (["mapping", "--autopilot=nonsense"], ["nonsense", "is no MAVLink connection"]),
        (["mapping", "--autopilot=file:///etc/passwd"], ["is no MAVLink connection"]),
        (["mapping", "--autopilot=tcp:127.0.0.1"], ["tcp:127.0.0.1", "needs a host and a port"]),
        (["mapping", "--autopilot=tcp::5760"], ["needs a host and a port"]),
        (["mapping", "--autopilot=udpin:127.0.0.1:70000"], ["port from 1 to 65535"]),
        (["mapping", "--autopilot=tcp:no such host:5760"], ["there is no host 'no such host'"]),
        ([*ARDUPILOT[:-1], "followed:/etc/passwd"], ["--sensors followed:/etc/passwd", "no serial device"]),
        ([*ARDUPILOT, "--physics-port", "0"], ["--physics-port 0"]),
        (["mapping", "--physics-port", "9012"], ["--physics-port", "--sensors simulated"]),
        (["inspection", *ARDUPILOT[1:], "--fail", "control@40"], ["--fail control", "only the simulated one"]),
        (["inspection", *ARDUPILOT[1:], "--fail", "ground_station:hung@40-60"], ["--fail ground_station", "only the simulated one"]),
    ],
)
def test_wrong_request_is_one_line_and_exit_code_2(arguments, names, capsys):
    assert main(arguments) == CANNOT_START
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    for name in names:
        assert name in said


@pytest.mark.parametrize("arguments", [["mapping", "--seed", "x"], [], ["mapping", "--nosuch"]])
def test_malformed_command_line_is_exit_code_2(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == CANNOT_START
    assert capsys.readouterr().err


def test_a_run_never_overwrites_another(tmp_path, capsys):
    (tmp_path / "summary.json").write_text("{}")
    assert main(["mapping", "--out", str(tmp_path)]) == CANNOT_START
    assert "never overwrites" in capsys.readouterr().err
    assert (tmp_path / "summary.json").read_text() == "{}"


def test_specification_survives_its_file(tmp_path):
    spec = parse(
        [
            "mapping",
            "--fail",
            "zed@30",
            "--fail",
            "lidar:sector@40-50",
            "--world",
            "forest",
            "--seed",
            "7",
            "--rate",
            "0",
            "--out",
            str(tmp_path / "run"),
        ]
    )
    spec.save(tmp_path / "run.json")
    assert RunSpec.load(tmp_path / "run.json") == spec
    assert {"faults:=zed@30,lidar:sector@40-50", f"world:={find_world('forest')}"} <= set(spec.launch_arguments())
    assert "simulate:=false" not in spec.launch_arguments()


def test_a_world_file_that_is_wrong_is_refused_with_its_line(tmp_path, capsys):
    world = tmp_path / "mine.yaml"
    world.write_text(find_world("yard").read_text().replace("keep_clear_m: 2.4", "keep_clear_m: far"))
    assert main(["mapping", "--world", str(world)]) == CANNOT_START
    line = 1 + find_world("yard").read_text().splitlines().index("keep_clear_m: 2.4")
    assert f"{world}:{line}: `keep_clear_m` should be a number" in capsys.readouterr().err


def test_real_autopilot_takes_the_place_of_the_simulator(tmp_path):
    url = f"udpin:127.0.0.1:{free_port()}"
    spec = parse(["mapping", "--autopilot", url, "--out", str(tmp_path / "run")])
    assert {"simulate:=false", f"autopilot:={url}"} <= set(spec.launch_arguments())


def test_ardupilot_flies_the_simulators_body(tmp_path):
    words = ["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--sensors", "simulated", "--fail", "zed@30", "--out", str(tmp_path / "run")]
    spec = parse(words)
    assert {"vehicle:=ardupilot", "autopilot:=tcp:127.0.0.1:5760", "faults:=zed@30"} <= set(spec.launch_arguments())
    assert "simulate:=false" not in spec.launch_arguments()
    assert spec.simulated
    url = f"followed:udpin:127.0.0.1:{free_port()}"
    followed = parse([*words[:4], url, *words[5:]])
    assert {f"vehicle:={url}", "rate:=0", "faults:=zed@30"} <= set(followed.launch_arguments())
    assert followed.simulated
    assert not parse(["mapping", "--autopilot", "tcp:127.0.0.1:5760", "--out", str(tmp_path / "run")]).simulated
    imperfect = parse(["mapping", "--imperfections", "realistic,exposure=0", "--out", str(tmp_path / "run")])
    assert "imperfections:=realistic,exposure=0" in imperfect.launch_arguments()
    imperfect.save(tmp_path / "run.json")
    saved = json.loads((tmp_path / "run.json").read_text())
    assert (saved["imperfections"], "launch" in saved) == ("realistic,exposure=0", False)
    assert RunSpec.load(tmp_path / "run.json") == imperfect


def test_mocks_need_no_ports_and_know_their_own_faults(tmp_path):
    spec = parse(["mapping", "--mock", "--fail", "pilot@20", "--behaviour", "gust.yaml", "--out", str(tmp_path / "run")])
    assert (spec.mock, spec.faults, spec.master_port, spec.mavlink_port) == (True, ("pilot@20",), 0, 0)
    assert spec.behaviour == (str(Path.cwd() / "gust.yaml"),)
    spec.save(tmp_path / "run.json")
    assert RunSpec.load(tmp_path / "run.json") == spec
    words = command(spec, Path("/alula"))
    assert [words[n + 1] for n, word in enumerate(words) if word == "--behaviour"] == [*spec.behaviour]
    assert words[words.index("--fail") + 1] == "pilot@20"


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        (["--behaviour", "x.yaml"], "add --mock"),
        (["--mock", "--autopilot", "tcp:127.0.0.1:5760"], "leave out --autopilot"),
        (["--mock", "--rate", "2"], "no --rate limits"),
        (["--mock", "--console"], "look at its report.html"),
        (["--mock", "--fail", "zed@x"], "write WHAT"),
        (["--mock", "--fail", "zed:xyz@30"], "zed can't be 'xyz'"),
    ],
)
def test_what_does_not_go_together_with_mocks(more, complaint, tmp_path):
    with pytest.raises(RequestError, match=complaint):
        parse(["mapping", "--out", str(tmp_path / "run"), *more])


def test_parallel_runs_get_different_domains_and_give_them_back():
    first, second = claim_domain(), claim_domain()
    assert first.domain != second.domain
    with pytest.raises(NoFreeDomainError):
        claim_domain([first.domain, second.domain])
    first.release()
    again = claim_domain([second.domain, first.domain])
    assert again.domain == first.domain
    second.release()
    again.release()


def test_a_domain_stays_claimed_as_long_as_any_process_has_the_claim():
    claim = claim_domain()
    heir = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, pass_fds=(claim.lock.fileno(),))
    claim.release()
    with pytest.raises(NoFreeDomainError):
        claim_domain([claim.domain])
    heir.communicate(b"\n")
    claim_domain([claim.domain]).release()


def test_free_port_can_be_bound():
    assert 1024 <= free_port() < 65536


# A child that ignores polite requests and a grandchild in a session of its own: what a crash leaves behind.
STUBBORN = """
import os, signal, subprocess, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
if len(sys.argv) > 1:
    subprocess.Popen([sys.executable, __file__], start_new_session=True)
print("up", flush=True)
time.sleep(600)
"""


def test_everything_of_a_run_ends_and_nothing_else(tmp_path):
    script = tmp_path / "stubborn.py"
    script.write_text(STUBBORN)
    run_id, other_id = uuid.uuid4().hex, uuid.uuid4().hex
    started = [
        subprocess.Popen([sys.executable, str(script), *more], env={**os.environ, RUN_ID_VARIABLE: identity}, stdout=subprocess.PIPE)
        for identity, more in ((run_id, ["family"]), (other_id, []))
    ]
    mine, other = started
    for process in (mine, mine, other):  # a grandchild writes where its parent does
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
    assert len(processes_of_run(run_id)) == 2
    assert len(end_run(run_id, timeout_s=0.3)) == 2
    assert processes_of_run(run_id) == []
    assert mine.wait(5) == -9
    assert other.poll() is None
    other.kill()
    other.wait()


def test_sensors_are_recorded_where_that_is_asked_for_and_can_be():
    assert "record:=sensors" in parse(["mapping", "--record", "sensors"]).launch_arguments()
    assert "record:=functional" in parse(["mapping"]).launch_arguments()
    with pytest.raises(RequestError, match="mocks measure nothing"):
        parse(["mapping", "--mock", "--record", "sensors"])


def test_how_much_sensors_will_take_is_said(tmp_path):
    assert "about 4 MB a second of flight, 0.5 GB for two minutes" in sensors_words(tmp_path)


def test_a_death_that_can_not_be_written_is_kept(tmp_path):
    (tmp_path / "run").mkdir()
    record = DeathRecord(tmp_path / "run/deaths.jsonl")
    (tmp_path / "run/deaths.jsonl").unlink()
    (tmp_path / "run").rmdir()
    record.add(Death("zed_depth", "gone", 1.0))
    assert [death.name for death in record.all] == ["zed_depth"]


def test_deaths_are_written_at_once_and_a_cut_line_is_left_out(tmp_path):
    record = DeathRecord(tmp_path / "deaths.jsonl")
    death = Death("zed_depth", describe_exit(-9), 12.5, respawned=True)
    record.add(death)
    with (tmp_path / "deaths.jsonl").open("a") as file:
        file.write('{"name": "ros_br')
    assert read_deaths(tmp_path / "deaths.jsonl") == [death]
    assert "SIGKILL" in death.sentence()
    assert "started again" in death.sentence()


def test_live_lines_wait_for_whole_events(tmp_path):
    said: list[str] = []
    live = LiveEvents(tmp_path, said.append)
    live.show_new()
    path = tmp_path / RECORD
    event = {"stamp_s": 3.0, "skillset": "navigation", "kind": "EXECUTION", "skill": "goto", "id": "1", "state": "RUNNING"}
    writer = RecordWriter(path)
    writer.write(EVENTS, 0, event)
    one = path.stat().st_size
    writer.write(EVENTS, 0, event)
    whole = path.read_bytes()
    path.write_bytes(whole[: one + 20])
    live.show_new()
    assert len(said) == 1
    path.write_bytes(whole)
    live.show_new()
    assert len(said) == 2
    assert "navigation.goto" in said[0]


def test_a_monitor_says_at_once_what_does_not_conform_and_the_verdict_repeats_it(tmp_path):
    said: list[str] = []
    monitor = monitor_of(parse(["mapping", "--mock", "--monitor", "--out", str(tmp_path / "run")]))
    assert monitor is not None
    live = LiveEvents(tmp_path, said.append, monitor)
    change = {"skillset": "perception", "kind": "TRANSITION", "resource": "zed_status", "cause": "extern", "stamp_s": 1.0}
    writer = RecordWriter(tmp_path / RECORD)
    writer.write(EVENTS, 0, {**change, "sequence": 1, "from_state": "UNKNOWN", "to_state": "OK"})
    live.show_new()
    assert len(said) == 1
    assert conformance_lines(monitor.verdict.as_dict()) == ["  monitor: all 1 events conform to the models"]
    writer.write(EVENTS, 0, {**change, "sequence": 2, "from_state": "BROKEN", "to_state": "OK"})
    live.show_new()
    what = "perception event 2 at 1.000 s: zed_status BROKEN -> OK (extern): zed_status was OK, not BROKEN"
    assert said[2:] == [f"does not conform to the model: {what}"]
    assert conformance_lines(monitor.verdict.as_dict()) == [f"  monitor: does not conform: {what}"]
    assert monitor_of(parse(["mapping", "--mock", "--out", str(tmp_path / "run")])) is None


def test_live_lines_count_from_lift_off_on_any_clock(tmp_path):
    said: list[str] = []
    live = LiveEvents(tmp_path, said.append)
    epoch_s = 1_900_000_000.0  # a mission clock that is the wall clock
    record = {"skillset": "navigation", "kind": "EXECUTION", "skill": "takeoff", "id": "1", "state": "RUNNING"}
    change = {"skillset": "navigation", "kind": "TRANSITION", "resource": "flight_status", "from_state": "ON_GROUND", "to_state": "IN_AIR"}
    stamps = (0.0, record), (2.5, record), (5.0, change), (35.0, record)
    writer = RecordWriter(tmp_path / RECORD)
    for stamp_s, what in stamps:
        writer.write(EVENTS, 0, {**what, "stamp_s": epoch_s + stamp_s, "cause": ""})
    live.show_new()
    assert [line.partition("  navigation")[0] for line in said] == ["start+ 0.0 s", "start+ 2.5 s", "t=   0.0 s", "t=  30.0 s"]


def test_event_line_tells_transitions_and_hides_requests():
    arrow = event_line(TransitionEvent(1, 1_000_000_000, "zed_status", "OK", "BROKEN", "extern", "perception"))
    assert arrow is not None
    assert "OK -> BROKEN" in arrow
    request = ExecutionEvent(2, 1_000_000_000, "zed_depthmap", "1", ExecutionState.REQUESTED, "", "", {}, {}, "perception")
    assert event_line(request) is None


def test_the_package_needs_no_ros_to_be_imported():
    code = "import alula_flight.fly, sys; assert not {'rospy', 'rclpy', 'open3d', 'matplotlib'} & set(sys.modules), 'imported too early'"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_page_beside_a_flight_ends_with_it(tmp_path):
    (tmp_path / "logs").mkdir()
    told, said = threading.Event(), []
    script = "import signal; print('http://127.0.0.1:8440/', flush=True); signal.pause()"
    with page_beside(tmp_path, lambda line: (said.append(line), told.set()), (sys.executable, "-c", script)):
        assert told.wait(30)
        (page,) = [process for process in psutil.Process().children() if script in process.cmdline()]
    assert not page.is_running()
    assert said == ["the operator's page: http://127.0.0.1:8440/"]


def test_a_page_that_can_not_be_served_stops_no_flight(tmp_path):
    (tmp_path / "logs").mkdir()
    told, said = threading.Event(), []
    with page_beside(
        tmp_path, lambda line: (said.append(line), told.set()), (sys.executable, "-c", "raise SystemExit('the port is taken')")
    ):
        assert told.wait(30)
    assert "logs/console.log" in said[0]
    assert "the port is taken" in (tmp_path / "logs" / "console.log").read_text()


def test_the_words_of_a_mocked_flight_that_ends_between_two_looks_are_told(monkeypatch, tmp_path):
    monkeypatch.setattr(mocked, "command", lambda *_: [sys.executable, "-c", "print('no such fault'); raise SystemExit(2)"])
    communicate, looks = subprocess.Popen.communicate, []

    def slow(process, *words, **options):
        """End the first look without a word, when the process has ended: a busy machine does that."""
        if not looks:
            looks.append(process.wait())
            raise subprocess.TimeoutExpired("flight", 0.1)
        return communicate(process, *words, **options)

    monkeypatch.setattr(subprocess.Popen, "communicate", slow)
    spec = RunSpec("mapping", str(tmp_path), "", 0, 0.0, (), "", None, 0, 0, 0, mock=True)
    assert MockFront(spec, print).fly() == (2, "no such fault\n")
