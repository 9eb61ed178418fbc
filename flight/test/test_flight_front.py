"""What the front checks before anything starts, and how it ends what it started."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import uuid
from dataclasses import replace

import psutil
import pytest

from alula.common.network import DomainClaim, NoFreeDomainError, claim_domain, is_claimed
from alula.common.processes import RUN_ID_VARIABLE, end_run, ends_within, processes_of_run
from alula.common.record import EVENTS, RecordWriter
from alula.common.record import FILE as RECORD
from alula.common.run_log import FILE
from alula.model.execution_state import ExecutionState
from alula.report.deaths import Death, describe_exit, note_again, note_death, read_deaths
from alula.report.live import LiveEvents, event_line
from alula.report.verdict import conformance_lines
from alula.runtime.core.events import ExecutionEvent, TransitionEvent
from alula.runtime.live.options import RunOffer, RunOption, read_offer, words_of
from alula.runtime.live.part import RunPart
from alula.runtime.live.spec import RequestError, RunSpec
from alula_flight.command_line import MASTER, USUAL_MASTER, check_no_master, parse, with_claim
from alula_flight.console_page import console_page
from alula_flight.outcome import CANNOT_START
from alula_flight.run import main, monitor_of


class Delivering(RunPart):
    """A robot that can be told where to and how, and whose parcels fail."""

    faults = {"parcel": ("lost", "wet")}  # noqa: RUF012  # as a robot's part writes it

    def add_options(self, parser):
        parser.add_argument("--to", metavar="ROOM", default="dock", help="where the parcel goes")
        parser.add_argument("--gently", action="store_true", help="slow in curves")
        parser.add_argument("--gear", type=int, choices=[1, 2], help="of the drive")


def test_the_robots_own_options_are_told_as_data(tmp_path, capsys):
    with pytest.raises(SystemExit) as told:
        parse(["--options"], Delivering())
    assert told.value.code == 0
    options = [
        RunOption("to", "where the parcel goes", metavar="ROOM", default="dock"),
        RunOption("gently", "slow in curves", takes_value=False),
        RunOption("gear", "of the drive", choices=("1", "2")),
    ]
    offer = RunOffer(tuple(options), {**Delivering.faults, "operator": ("pause", "abort")})
    assert read_offer(capsys.readouterr().out) == offer
    words = words_of({"to": "lab 3", "gently": "", "gear": "2"}, options)
    assert words == ["--to=lab 3", "--gently", "--gear=2"]
    assert parse(["mapping", *words, "--out", str(tmp_path / "run")], Delivering()).scenario == "mapping"
    with pytest.raises(RequestError, match="--gear: there is no '3'; there are 1, 2"):
        words_of({"gear": "3"}, options)
    with pytest.raises(RequestError, match="no option --rate; it declares --to, --gently, --gear"):
        words_of({"rate": "0"}, options)


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


def test_the_master_of_another_graph_is_not_silently_left_aside(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv(MASTER, "http://10.0.0.2:11311")
    assert main(["mapping", "--out", str(tmp_path / "run")]) == CANNOT_START
    told = capsys.readouterr().err
    assert "ROS_MASTER_URI is http://10.0.0.2:11311" in told
    assert "--on NAME" in told
    assert not (tmp_path / "run").exists()


def test_the_usual_master_is_none_that_the_caller_has_exported():
    exported = {MASTER: "http://127.0.0.1:11311"}
    check_no_master({})
    check_no_master({**exported, USUAL_MASTER: exported[MASTER]})
    with pytest.raises(RequestError, match="--on NAME"):
        check_no_master(exported)


def test_a_specification_survives_its_file(tmp_path):
    own = {"speed": 2.5, "port": None}
    spec = RunSpec("mapping", str(tmp_path), "id", seed=7, faults=("zed@30", "lidar:sector@40-50"), world="w.yaml", domain=3, own=own)
    spec.save(tmp_path / "run.json")
    assert json.loads((tmp_path / "run.json").read_text())["speed"] == 2.5
    assert RunSpec.load(tmp_path / "run.json") == spec


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--limit", "-1"], "--limit -1: must be 0"),
        (["--commanded"], "the scenario mapping has a mission; name one without"),
    ],
)
def test_what_a_run_with_a_mission_can_not_be(words, told, tmp_path):
    with pytest.raises(RequestError, match=told):
        parse(["mapping", *words, "--out", str(tmp_path / "run")], RunPart())


def test_behaviour_is_of_mocks(tmp_path):
    with pytest.raises(RequestError, match="add --mock"):
        parse(["mapping", "--behaviour", "x.yaml", "--out", str(tmp_path / "run")], RunPart())


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
    heir = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, pass_fds=[lock.fileno() for lock in claim.locks])
    claim.release()
    with pytest.raises(NoFreeDomainError):
        claim_domain([claim.domain])
    heir.communicate(b"\n")
    claim_domain([claim.domain]).release()


def test_runs_in_namespaces_share_a_domain_that_is_named_and_no_other_run_gets_it():
    rover = claim_domain(namespace="/rover")
    drone = claim_domain([rover.domain], "/drone")
    assert drone.domain == rover.domain
    assert drone.seat != rover.seat, "what follows from it, as ports, is apart"
    with pytest.raises(NoFreeDomainError, match=f"DDS domain {rover.domain} is in use by a run without a namespace, or in /rover; end it"):
        claim_domain([rover.domain], "/rover")
    with pytest.raises(NoFreeDomainError, match="is in use by other runs; end it, or give each run a namespace of its own"):
        claim_domain([rover.domain])
    alone = claim_domain()
    assert alone.domain not in {rover.domain, rover.seat, drone.seat}
    with pytest.raises(NoFreeDomainError):
        claim_domain([alone.domain], "/rover")
    other = claim_domain(namespace="/other")
    assert other.domain != rover.domain, "a domain is shared by those only that ask for it"
    rover.release()
    assert is_claimed(rover.domain), "the drone is still there"
    claim_domain([drone.domain], "/rover").release()
    for one in (drone, alone, other):
        one.release()
    claim_domain([drone.domain]).release()


def test_domain_and_namespace_are_part_of_the_request(tmp_path):
    words = ["mapping", "--out", str(tmp_path / "run")]
    request = parse([*words, "--domain", "7", "--namespace", "fleet/rover/"], RunPart())
    assert (request.domain, request.namespace) == (7, "/fleet/rover")
    run = with_claim(request, DomainClaim(7, 8, ()), RunPart())
    run.save(tmp_path / "run.json")
    assert RunSpec.load(tmp_path / "run.json") == run
    plain = parse(words, RunPart())
    assert (plain.domain, plain.namespace) == (0, "")
    with pytest.raises(RequestError, match="--domain 233: a run has a DDS domain from 1 to 101"):
        parse([*words, "--domain", "233"], RunPart())
    with pytest.raises(RequestError, match="--namespace ro-ver: write a name such as rover"):
        parse([*words, "--namespace", "ro-ver"], RunPart())


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


def test_a_death_that_can_not_be_written_ends_nothing(tmp_path):
    note_death(tmp_path / "gone", Death("driver", "gone", 1.0))
    assert read_deaths(tmp_path / "gone") == []


def test_deaths_are_written_at_once_and_a_cut_line_is_left_out(tmp_path):
    death = Death("driver", describe_exit(-9), 12.5)
    note_death(tmp_path, death)
    note_death(tmp_path, death)
    note_again(tmp_path, "driver", 14.0)
    with (tmp_path / FILE).open("a") as file:
        file.write('{"kind": "death", "name": "ros_br')
    assert read_deaths(tmp_path) == [replace(death, again_s=14.0), death]
    assert [f"{one.sentence()}; {one.fate}" for one in read_deaths(tmp_path)] == [
        "driver died (signal SIGKILL) at 12.5 s of mission clock; it was started again at 14.0 s of mission clock",
        "driver died (signal SIGKILL) at 12.5 s of mission clock; it stayed dead",
    ]


def test_the_end_of_a_child_is_waited_for_and_no_longer():
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    assert not ends_within(child, 0.01)
    child.communicate(b"\n")
    assert ends_within(child, 60.0)
    dying = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    threading.Timer(0.1, dying.kill).start()
    assert ends_within(dying, 60.0)
    assert dying.returncode == -9
    dying.communicate()


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
    monitor = monitor_of(parse(["mapping", "--monitor", "--out", str(tmp_path / "run")], RunPart()))
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
    assert monitor_of(parse(["mapping", "--out", str(tmp_path / "run")], RunPart())) is None


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
    code = "import alula_flight.run, sys; assert not {'rospy', 'rclpy', 'open3d', 'matplotlib'} & set(sys.modules), 'imported too early'"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_page_of_a_run_ends_with_it(tmp_path):
    (tmp_path / "logs").mkdir()
    told, said = threading.Event(), []
    script = "import signal; print('http://127.0.0.1:8440/', flush=True); signal.pause()"
    with console_page(tmp_path, lambda line: (said.append(line), told.set()), (sys.executable, "-c", script)):
        assert told.wait(30)
        (page,) = [process for process in psutil.Process().children() if script in process.cmdline()]
    assert not page.is_running()
    assert said == ["the operator's page: http://127.0.0.1:8440/"]


def test_a_page_that_can_not_be_served_stops_no_flight(tmp_path):
    (tmp_path / "logs").mkdir()
    told, said = threading.Event(), []
    with console_page(
        tmp_path, lambda line: (said.append(line), told.set()), (sys.executable, "-c", "raise SystemExit('the port is taken')")
    ):
        assert told.wait(30)
    assert "logs/console.log" in said[0]
    assert "the port is taken" in (tmp_path / "logs" / "console.log").read_text()
