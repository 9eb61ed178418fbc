"""``alula run SCENARIO --mock``: what does not go together with mocks, what is refused, and who ended it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from alula.cli import new, run
from alula.common import run_log
from alula.common.record import FILE, read_record
from alula.missions.mocked import STOP_S
from alula.report.aborts import OPERATOR, ReportedAbort, read_abort


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["mapping"], "without --mock a run needs an installation with ROS"),
        (["mapping", "--mock", "--autopilot", "tcp:127.0.0.1:5760"], "--autopilot: a run over mocks has no such option"),
        (["mapping", "--mock", "--rate", "2"], "--rate: a run over mocks has no such option"),
        (["mapping", "--mock", "--console"], "--console: a run over mocks has no such option"),
        (["mapping", "--mock", "--fail", "zed@x"], "write WHAT"),
        (["mapping", "--mock", "--fail", "camera"], "there is no fault 'camera'"),
        (["mapping", "--mock", "--world", "nowhere"], "there is no world nowhere"),
        (["mapping", "--mock", "--seed", "-1"], "--seed -1"),
        (["mapping", "--mock", "--limit", "-1"], "--limit -1: must be 0"),
        (["mapping", "--mock", "--limit", "nan"], "--limit nan: must be 0"),
        (["nosuch", "--mock"], "there is no scenario 'nosuch'"),
    ],
)
def test_what_can_not_be_is_one_line_and_leaves_nothing(words: list[str], complaint: str, tmp_path: Path, capsys) -> None:
    assert run.main([*words, "--out", str(tmp_path / "run")]) == run.CANNOT_START
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith("alula run: ")
    assert complaint in said
    assert not (tmp_path / "run").exists()


WRONG = (
    ("robot.yaml", "departure: bot.whels FREE", "robot.yaml: `departure`: the robot has no resource `whels`; did you mean `wheels`?"),
    ("robot.yaml", "departure: bot.wheels FRE", "robot.yaml: `departure`: the resource `wheels` has no state `FRE`; did you mean `FREE`?"),
    ("scenarios/patrol.yaml", "fallback: drivee", "patrol.yaml: `fallback`: the robot has no skill `drivee`; did you mean `drive`?"),
    ("scenarios/patrol.yaml", "motion: [bot.drive, dirve]", "patrol.yaml: `motion`: the robot has no skill `dirve`; did you mean `drive`?"),
    ("missions/patrol.xml", "", "missions/patrol.xml:40:"),
    ("skillsets/types.yaml", "Goal: geometry_msgs/PoseStampd", "geometry_msgs has no message `PoseStampd`"),
)


@pytest.mark.parametrize(("file", "line", "complaint"), WRONG)
def test_a_wrong_name_in_a_side_file_is_refused_with_its_place(
    file: str, line: str, complaint: str, tmp_path: Path, capsys, monkeypatch
) -> None:
    bot = tmp_path / "bot"
    assert new.main(["robot", str(bot)]) == 0
    monkeypatch.chdir(bot)
    monkeypatch.delenv("ALULA_ROBOT", raising=False)
    text = (bot / file).read_text()
    (bot / file).write_text(
        f"{text}{line}\n" if line else text.replace('name="speed_m_s" default="0.5"', 'name="speed_m_s" default="0.6 km"')
    )
    capsys.readouterr()
    assert run.main(["patrol", "--mock", "--out", str(tmp_path / "run")]) == run.CANNOT_START
    said = capsys.readouterr().err
    assert said.count("\n") == (1 if file != "skillsets/types.yaml" else 2)  # with its hint
    assert complaint in said
    assert not (tmp_path / "run").exists()


def test_it_leaves_what_a_live_run_leaves(tmp_path: Path, capsys) -> None:
    out = tmp_path / "run"
    assert run.main(["mapping", "--mock", "--monitor", "--fail", "zed@20", "--seed", "3", "--out", str(out)]) == 0
    asked = json.loads((out / "run.json").read_text())
    assert (asked["scenario"], asked["seed"], asked["faults"], asked["mock"], asked["domain"]) == ("mapping", 3, ["zed@20"], True, 0)
    assert Path(asked["world"]).is_file()
    assert {path.name for path in out.iterdir()} >= {FILE, "summary.json", "report.html", "timeline.svg", "tree.svg"}
    told = capsys.readouterr()
    assert "mission accomplished in degraded mode" in told.out
    assert "  perception.zed_status: OK -> BROKEN" in told.err


def test_a_limit_ends_it(tmp_path: Path, capsys) -> None:
    out = tmp_path / "run"
    assert run.main(["mapping", "--mock", "--limit", "20", "--out", str(out)]) == 1
    assert "its limit of 20 s is over" in capsys.readouterr().out
    summary = json.loads((out / "summary.json").read_text())
    assert summary["outcome"] == "aborted"
    assert summary["duration_s"] < 20 + STOP_S


def test_ctrl_c_is_the_operators(tmp_path: Path) -> None:
    out = tmp_path / "run"
    script = (
        "import os, signal, sys; from alula.cli import run; from alula.missions.mocked import MockedMission\n"
        "begin = MockedMission.run\n"
        "def interrupted(self):\n"
        "    self.world.clock.after(30.0, lambda: os.kill(os.getpid(), signal.SIGINT))\n"
        "    return begin(self)\n"
        "MockedMission.run = interrupted\n"
        "sys.exit(run.main(sys.argv[1:]))"
    )
    words = [sys.executable, "-c", script, "mapping", "--mock", "--out", str(out)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120, env=dict(os.environ))
    assert done.returncode == 1, done.stderr
    assert read_abort(out) == ReportedAbort(OPERATOR, "Ctrl-C")
    assert "mission aborted by the operator: Ctrl-C" in done.stdout
    assert run_log.account(out, read_record(out))["reason"] == f"told to end by {signal.SIGINT.name}"
