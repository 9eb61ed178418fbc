"""Missions on what runs already: what the command line refuses, and how they end."""

from __future__ import annotations

import json
import socket
import sys
import threading

import pytest

from alula.common.deployments import DeploymentError
from alula.common.network import free_port
from alula.common.run_log import read_held
from alula.report.aborts import read_abort
from alula.report.deaths import read_deaths
from alula.runtime.live.part import RunPart
from alula.runtime.live.spec import RequestError, RunSpec
from alula_flight import attached as attachments
from alula_flight import rest
from alula_flight.attached import AttachedSupervisor, PartsWatch
from alula_flight.command_line import parse
from alula_flight.run import CANNOT_START, main
from alula_flight.station import state as states
from alula_flight.station.__main__ import main as commands
from alula_flight.station.master import why_no_master
from alula_flight.station.state import PartState, StationState
from alula_flight.station.station import Station


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--on", "rbot"], "there is no deployment 'rbot'.*did you mean `robot`"),
        (["--on", "robot", "--fail", "obstacle@1"], "--fail: is of runs with a graph of their own"),
        (["--on", "robot", "--domain", "7"], "--domain: the deployment says it"),
        (["--on", "robot", "--namespace", "x"], "--namespace: the deployment says it"),
        (["--on", "robot", "--behaviour", "x"], "add --mock"),
    ],
)
def test_what_a_run_on_what_runs_already_can_not_be(robot, words, told):
    with pytest.raises((RequestError, DeploymentError), match=told):
        parse(["patrol", *words], RunPart())


def test_a_run_is_on_the_deployment_that_its_process_belongs_to(robot, monkeypatch):
    monkeypatch.setenv("ALULA_DEPLOYMENT", "robot")
    spec = parse(["patrol"], RunPart())
    assert (spec.deployment, spec.domain, spec.master_port) == ("robot", 42, 0)


def test_a_master_that_does_not_answer_is_said_before_anything_begins(robot, capsys):
    file = robot / "deployments/robot.yaml"
    file.write_text(file.read_text().replace("127.0.0.1:11311", f"127.0.0.1:{free_port()}", 1))
    assert main(["patrol", "--on", "robot"]) == CANNOT_START
    told = capsys.readouterr().err
    assert "no ROS master at http://127.0.0.1:" in told
    assert "`ros1: master`" in told
    assert not (robot / "runs").exists()
    assert "not known" in why_no_master("http://no-such-host.invalid:11311")


NOT_HTTP, A_PAGE, NOT_FOUND = (
    b"SSH-2.0-OpenSSH_9.2p1\r\n",
    b"HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n<html><p>Welcome</html>",
    b"HTTP/1.0 404 Not Found\r\nContent-Length: 0\r\n\r\n",
)


@pytest.mark.parametrize("answer", [NOT_HTTP, A_PAGE, NOT_FOUND], ids=["no HTTP", "a page", "not found"])
def test_another_program_at_the_masters_port_is_told(answer: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(65_536)
                connection.sendall(answer)
                connection.shutdown(socket.SHUT_WR)
                while connection.recv(65_536):  # what is left unread would reset the connection
                    pass

        thread = threading.Thread(target=serve)
        thread.start()
        told = why_no_master(f"http://127.0.0.1:{server.getsockname()[1]}")
        thread.join()
    assert told == "another program than a ROS master has that port"


def test_a_mission_keeps_the_parts_from_being_changed(robot, capsys):
    station = Station("robot")
    lock = states.take(station.folder / states.MISSION_LOCK)
    states.note_holder(lock, "the mission patrol")
    for words in (["up", "robot"], ["down"]):
        assert commands(words) == CANNOT_START
        assert "the mission patrol, process" in capsys.readouterr().err
    lock.close()


def test_the_status_of_what_is_down(robot, capsys):
    assert commands(["status", "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert (said["deployment"], said["up"], said["domain"], said["parts"], said["mission"]) == ("robot", False, 42, {}, "")
    assert commands(["up", "robot", "--restart", "rover"]) == CANNOT_START
    assert "--restart rover: the part managers serves it" in capsys.readouterr().err
    assert commands(["up", "robot", "--restart", "brige"]) == CANNOT_START
    assert "did you mean `bridge`" in capsys.readouterr().err
    assert commands(["down"]) == 0


class Watched(RunPart):
    """Somebody else has the robot for some looks."""

    def __init__(self, looks=0):
        self.looks, self.rested = looks, 0

    def held(self, clock):
        self.looks -= 1
        return "the pilot has it, at 3.0 m" if self.looks >= 0 else ""

    def bring_to_rest(self, clock):
        self.rested += 1


def attached(robot, part, code, *, limit_s=0.0):
    """Return the supervisor of a mission on the robot's deployment that ends at once with this code."""
    out = robot / "runs/patrol"
    (out / "logs").mkdir(parents=True, exist_ok=True)
    supervisor = AttachedSupervisor(RunSpec("patrol", str(out), "id", deployment="robot", limit_s=limit_s, robot=str(robot)), part)
    supervisor._mission = lambda: (sys.executable, "-c", f"import os, signal; {code}")
    supervisor._recording = lambda: ("sleep", "100")
    supervisor._listen = lambda: None
    return supervisor


@pytest.mark.parametrize(
    ("code", "looks", "ended", "rested"),
    [("exit(0)", 0, 0, 0), ("exit(1)", 0, 1, 1), ("os.kill(os.getpid(), signal.SIGKILL)", 0, 1, 1), ("exit(0)", 9, 0, 3)],
    ids=["accomplished", "given up", "killed", "accomplished, and somebody else has it"],
)
def test_a_mission_on_what_runs_leaves_a_robot_at_rest(robot, monkeypatch, code, looks, ended, rested):
    monkeypatch.setattr(attachments, "LOOK_S", 0.01)
    monkeypatch.setattr(rest, "LOOK_S", 60.0)  # it comes to rest at once: no look is due
    part = Watched()
    supervisor = attached(robot, part, code)
    mission_of = supervisor._start

    def start(name, words):
        mission = mission_of(name, words)
        if name == "mission":
            mission.wait()
            part.looks = looks
        return mission

    monkeypatch.setattr(supervisor, "_start", start)
    assert supervisor.run() == ended
    assert part.rested >= rested if rested else part.rested == 0


def test_a_mission_on_what_runs_says_what_it_waits_for(robot, monkeypatch):
    monkeypatch.setattr(attachments, "LOOK_S", 0.01)
    monkeypatch.setattr("alula_flight.waits.TELL_HELD_S", 0.0)
    assert attached(robot, Watched(looks=4), "exit(1)").run() == 1
    said = read_held(robot / "runs/patrol")
    assert said
    assert all(how.startswith("the pilot has it, at 3.0 m, for ") for how in said)


def test_a_limit_ends_a_mission_on_what_runs_and_a_run_that_watches_on(robot, monkeypatch):
    monkeypatch.setattr(attachments, "LOOK_S", 0.01)
    supervisor = attached(robot, Watched(looks=10**9), "exit(1)", limit_s=0.3)
    assert supervisor.run() == 1
    end = read_abort(robot / "runs/patrol")
    assert end is not None
    assert end.why == "its limit of 0.3 s is over"


def test_a_part_that_ends_under_a_mission_is_in_its_record_and_earlier_ends_are_not(tmp_path):
    state = StationState(parts={"bridge": PartState(1, 1.0, states.RUNNING, deaths=4)})
    state.save(tmp_path)
    watch = PartsWatch(tmp_path, tmp_path)
    watch.look(1.0)
    state.parts["bridge"] = PartState(0, 0.0, states.WAITING, deaths=5, why="signal SIGKILL: x")
    state.save(tmp_path)
    watch.look(2.0)
    state.parts["bridge"].state = states.RUNNING
    state.save(tmp_path)
    watch.look(3.0)
    assert [(one.name, one.how, one.when_s, one.again_s) for one in read_deaths(tmp_path)] == [("bridge", "signal SIGKILL: x", 2.0, 3.0)]
