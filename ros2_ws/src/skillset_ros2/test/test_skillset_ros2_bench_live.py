"""The benchmark's smallest case in real processes: what it counts, and that nothing of it is left."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("navigation_interfaces.action")

from alula.common.network import is_claimed
from alula.model.execution_state import ExecutionState
from alula.runtime.handle import SkillHandle
from alula_testing.waits import until
from skill_bench.cases import CASES
from skill_bench.clients import States
from skill_bench.run import LEAST, open_bench

LIMIT_S = 60.0


def children(pid: int) -> list[int]:
    return [int(child) for task in Path(f"/proc/{pid}/task").iterdir() for child in (task / "children").read_text().split()]


def test_the_smallest_case_counts_what_it_says():
    said: list[str] = []
    with open_bench(said.append) as bench:
        measured = bench.measure(CASES[0], LEAST)
        domain = bench.domain
        assert is_claimed(domain)
    assert {name: times.number for name, times in measured.times.items()} == {
        "request": 6,  # three that are stopped, three that lose their resource
        "interrupt": 3,
        "violation": 3,
        "told": 3,
        "asked": 3,
        "goal": 3,
        "topic": 3,
    }
    assert all(0 < times.p50_ms <= times.p95_ms for times in measured.times.values())
    # The service's call comes before the transition that is asked for by it.
    assert measured.times["violation"].p50_ms < measured.times["asked"].p95_ms
    assert measured.load.rss_mb > 10
    assert measured.load.idle_percent >= 0
    assert said[0] == "1 skill: starts"
    assert multiprocessing.active_children() == []
    assert not is_claimed(domain)


def test_a_state_counts_from_when_it_was_entered_first():
    handle = SkillHandle("skill_0", "1")
    handle.enter(ExecutionState.RUNNING)
    states = States(handle)
    first_ns = states.wait(ExecutionState.RUNNING)
    handle.run(0.5)
    threading.Timer(0.02, handle.end, (ExecutionState.INTERRUPTED, "", "")).start()
    assert states.wait(ExecutionState.INTERRUPTED) - first_ns >= 0.02e9
    assert states.wait(ExecutionState.RUNNING) == first_ns


def test_an_interrupted_run_leaves_no_process():
    command = [sys.executable, "-m", "skill_bench", "--quick", "--case", "1 skill"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True) as process:
        limit = threading.Timer(LIMIT_S, process.kill)
        limit.start()
        assert process.stderr is not None
        assert "1 skill: starts" in process.stderr.readline()
        started = children(process.pid)
        os.killpg(process.pid, signal.SIGINT)  # as the terminal does: to all of them
        out, _ = process.communicate()
        limit.cancel()
    assert process.returncode == 130
    assert out == ""
    assert len(started) >= 3  # the bare server and client, the managers
    # The last of them ends when it notices that the first has.
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in started), f"all of {started} end", LIMIT_S)
