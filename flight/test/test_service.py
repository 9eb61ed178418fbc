"""Systemd's unit of a deployment."""

from __future__ import annotations

import configparser
import os
import shutil
import subprocess

import pytest
from station_rig import ROOT, sleeper

from alula_flight.run import CANNOT_START
from alula_flight.station import service as services
from alula_flight.station import state as states
from alula_flight.station.__main__ import main as commands
from alula_flight.station.state import PartState, StationState, living
from alula_flight.station.station import Station


@pytest.mark.parametrize("user", ["", "robo"])
def test_the_unit_keeps_the_deployment_up(robot, user):
    read = configparser.ConfigParser(strict=False, interpolation=None)
    read.optionxform = str
    read.read_string(services.unit(Station("robot"), user, os.environ))
    service = dict(read["Service"])
    assert service["ExecStart"] == f"{ROOT}/setup/in_ros1 python3 -m alula_flight.station.keeper robot"
    assert (service["Type"], service["WatchdogSec"], service["Restart"], service.get("User", "")) == ("notify", "60", "on-failure", user)
    assert service["KillMode"] == "process", "the parts outlive their keeper, and the next one takes them over"
    assert service["WorkingDirectory"] == str(robot)
    assert read["Unit"]["StartLimitBurst"] == "5"
    assert read["Install"]["WantedBy"] == ("multi-user.target" if user else "default.target")
    assert ("After" in read["Unit"]) is bool(user)


def test_systemd_reads_the_unit(robot, tmp_path):
    if shutil.which("systemd-analyze") is None:
        pytest.skip("there is no systemd-analyze on this machine")
    path = tmp_path / services.unit_name(Station("robot"))
    path.write_text(services.unit(Station("robot"), "", os.environ))
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True, check=False)
    assert path.name not in done.stderr, done.stderr


@pytest.mark.parametrize(
    ("word", "written"), [("/a/b", "/a/b"), ("a b", '"a b"'), ('say "x"', '"say \\"x\\""'), ("50%", "50%%"), ("$HOME", '"$$HOME"')]
)
def test_words_of_a_unit_mean_what_they_say(word, written):
    assert services.quoted(word) == written


def test_a_service_is_printed_anywhere_and_installed_where_systemd_runs(robot, capsys, monkeypatch, tmp_path):
    assert commands(["service", "--print", "robot"]) == 0
    assert capsys.readouterr().out.startswith("[Unit]\n")
    monkeypatch.setattr(services, "BOOTED", tmp_path / "no-such-folder")
    assert commands(["service", "install", "robot"]) == CANNOT_START
    assert "systemd does not run on this computer" in capsys.readouterr().err
    for words in (["robot"], ["start", "robot"], ["install"], ["--print", "install", "robot"]):
        assert commands(["service", *words]) == CANNOT_START
        assert "it takes: install DEPLOYMENT" in capsys.readouterr().err


def test_a_service_is_installed_enabled_and_removed(robot, capsys, monkeypatch, tmp_path):
    asked = tmp_path / "asked"
    control = tmp_path / "bin/systemctl"
    control.parent.mkdir()
    control.write_text(f'#!/bin/sh\necho "$@" >> {asked}\n')
    control.chmod(0o755)
    monkeypatch.setenv("PATH", f"{control.parent}:{os.environ['PATH']}")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(services, "BOOTED", tmp_path)
    name = services.unit_name(Station("robot"))
    assert commands(["service", "install", "robot"]) == 0
    assert (tmp_path / "config/systemd/user" / name).read_text().startswith("[Unit]\n")
    left = subprocess.Popen(sleeper().words, stdout=subprocess.DEVNULL)
    folder = Station("robot").folder
    folder.mkdir(parents=True, exist_ok=True)
    start = states.start_of(left.pid)
    StationState(parts={"bridge": PartState(pid=left.pid, start=start, state=states.RUNNING)}).save(folder)
    assert commands(["service", "remove", "robot"]) == 0
    assert living(left.pid, start) is None, "what a keeper has left is ended"
    assert not (tmp_path / "config/systemd/user" / name).exists()
    user = ["daemon-reload", f"enable --now {name}", f"disable --now {name}", "daemon-reload"]
    assert asked.read_text().splitlines() == [f"--user {one}" for one in user]
    assert commands(["service", "remove", "robot"]) == CANNOT_START
    assert "nothing was installed" in capsys.readouterr().err
