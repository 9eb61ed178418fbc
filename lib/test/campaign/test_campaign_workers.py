"""A campaign whose workers die, or that is interrupted itself: it loses what was under way, and nothing else, and leaves no process."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from campaign_mocks import fly_recorded

from alula.campaign.table import ROWS
from alula.common.processes import RUN_ID_VARIABLE
from alula.common.robots import find_robot

CAMPAIGN = "over: simulator\nscenarios: [mapping]\nruns: 3\ndraw: {in_turn: [[]]}\nat_once: 1\n"
# In place of ./alula: a run leaves a recorded flight. One of the second run's seed ends its worker, or goes on for ever.
ALULA = """#!/bin/sh
here=$(dirname "$0")
[ "$2" = --options ] && { echo '{"options": [], "faults": {}}'; exit 0; }
for word; do out=$word; done
if [ ! -e "$here/first" ]; then echo "$4" >"$here/first"
elif [ ! -e "$here/doomed" ]; then echo "$4" >"$here/doomed"; fi
if [ "$4" = "$(cat "$here/doomed" 2>/dev/null)" ]; then
  case $(cat "$here/second") in
    dies) kill -9 $PPID; exit 1 ;;
    dies_once) [ -e "$here/died" ] || { touch "$here/died"; kill -9 $PPID; exit 1; } ;;
    goes_on) mkdir "$out"; echo '{"run_id": "left"}' >"$out/run.json"; env ALULA_RUN_ID=left sleep 1000; exit 1 ;;
  esac
fi
mkdir -p "$out" && cp "$here/recorded/skills.mcap" "$here/summary.json" "$out"
"""
SUMMARY = {"outcome": "accomplished", "reason": "", "landed": True, "collisions": 0, "min_clearance_m": 1.2, "problems": [], "skills": []}


def begin(folder: Path, second: str) -> subprocess.Popen[str]:
    """Begin a campaign of three runs."""
    robot = find_robot().root
    (folder / "alula").write_text(ALULA, encoding="utf-8")
    (folder / "alula").chmod(0o755)
    (folder / "second").write_text(second, encoding="utf-8")
    (folder / "summary.json").write_text(json.dumps(SUMMARY), encoding="utf-8")
    (folder / "recorded").mkdir()
    fly_recorded(folder / "recorded")
    (folder / "c.yaml").write_text(CAMPAIGN, encoding="utf-8")
    words = [sys.executable, "-m", "alula.cli.campaign", str(folder / "c.yaml"), "--out", str(folder / "out")]
    environment = {**os.environ, "ALULA_ROOT": str(folder), "ALULA_ROBOT": str(robot)}
    return subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)


def rows_of(folder: Path) -> list[int]:
    return [json.loads(line)["run"] for line in (folder / "out" / ROWS).read_text(encoding="utf-8").splitlines()]


@pytest.mark.parametrize(("second", "rows", "code"), [("dies_once", [0, 1, 2], 0), ("dies", [0, 2], 1)])
def test_a_worker_that_dies_loses_only_its_run(second: str, rows: list[int], code: int, tmp_path: Path) -> None:
    with begin(tmp_path, second) as campaign:
        _, said = campaign.communicate(timeout=300)
    assert (rows_of(tmp_path), campaign.returncode) == (rows, code), said
    told = "alula campaign: 1 runs were lost with their workers (1); the same command does them again\n"
    assert (told in said) is (second == "dies")


def runs_left() -> list[psutil.Process]:
    left = []
    for process in psutil.process_iter():
        try:
            left += [process] if process.environ().get(RUN_ID_VARIABLE) == "left" else []
        except psutil.Error:
            continue
    return left


def test_a_campaign_that_is_interrupted_leaves_no_run(tmp_path: Path) -> None:
    with begin(tmp_path, "goes_on") as campaign:
        while campaign.poll() is None and not runs_left():
            psutil.wait_procs([psutil.Process(campaign.pid)], timeout=0.05)
        assert runs_left(), campaign.stderr.read() if campaign.stderr else ""
        campaign.send_signal(signal.SIGINT)
        _, said = campaign.communicate(timeout=300)
    assert (campaign.returncode, runs_left()) == (1, [])
    assert "interrupted; the same command goes on from " in said
    assert rows_of(tmp_path) == [0]
