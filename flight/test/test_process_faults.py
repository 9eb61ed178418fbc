"""Processes that are made to die or to hang at a moment of the mission clock, with real processes in place of nodes."""

from __future__ import annotations

import math
import subprocess
import sys

import psutil
import pytest

from alula.common.faults import parse_fault
from alula.common.processes import RUN_ID_VARIABLE
from alula.common.run_log import FAULT, FILE, read
from alula_flight.process_faults import ProcessFault, ProcessFaults
from alula_testing.waits import until

LIFT_OFF_S = 100.0


class Node:
    """What roslaunch has of a process."""

    def __init__(self) -> None:
        self.respawn_delay = 0.2
        self.popen = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], env={RUN_ID_VARIABLE: "a test"})

    def is_alive(self) -> bool:
        return self.popen.poll() is None

    @property
    def status(self) -> str:
        return psutil.Process(self.popen.pid).status() if self.is_alive() else "dead"


@pytest.fixture
def node():
    node = Node()
    yield node
    node.popen.kill()
    node.popen.wait()


def faults_of(text: str, node: Node | None, out) -> ProcessFaults:
    made = ProcessFaults([ProcessFault(parse_fault(text), "video_stream")], {"video_stream": node}.get, out)
    made.look(LIFT_OFF_S - 1.0)
    made.departed(LIFT_OFF_S)
    return made


def told(out) -> list[tuple[str, str, float]]:
    return [tuple(one.values()) for one in read(out, FAULT)]


def test_a_process_dies_at_its_time_and_is_not_started_again(node, tmp_path):
    faults = faults_of("encoder@40", node, tmp_path)
    faults.look(LIFT_OFF_S + 39.98)
    assert node.is_alive()
    assert not (tmp_path / FILE).exists()
    faults.look(LIFT_OFF_S + 40.0)
    assert node.popen.wait(10.0) == -9
    assert node.respawn_delay == math.inf
    faults.look(LIFT_OFF_S + 400.0)
    assert told(tmp_path) == [("encoder", "killed", LIFT_OFF_S + 40.0)]


def test_a_process_that_was_killed_for_a_while_is_started_again_then(node, tmp_path):
    faults = faults_of("encoder@40-45", node, tmp_path)
    for t_s in (40.0, 44.9):
        faults.look(LIFT_OFF_S + t_s)
    assert node.popen.wait(10.0) == -9
    assert node.respawn_delay == math.inf
    faults.look(LIFT_OFF_S + 45.0)
    assert node.respawn_delay == 0.2
    assert told(tmp_path)[1:] == [("encoder", "ok", LIFT_OFF_S + 45.0)]


def test_one_that_is_started_in_spite_of_that_dies_too(node, tmp_path):
    faults = faults_of("encoder@40-45", node, tmp_path)
    faults.look(LIFT_OFF_S + 40.0)
    node.popen.wait(10.0)
    other = node.popen = Node().popen
    faults.look(LIFT_OFF_S + 40.02)
    assert other.wait(10.0) == -9


def test_a_process_that_hangs_goes_on_at_the_end(node, tmp_path):
    faults = faults_of("encoder:hung@40-45", node, tmp_path)
    faults.look(LIFT_OFF_S + 41.0)
    until(lambda: node.status == "stopped", "it stops", 10.0)
    faults.look(LIFT_OFF_S + 45.0)
    until(lambda: node.status in {"sleeping", "running"}, "it goes on", 10.0)
    assert node.respawn_delay == 0.2


def test_at_the_end_of_the_run_a_hung_process_can_be_told_to_end(node, tmp_path):
    faults = faults_of("encoder:hung@40", node, tmp_path)
    faults.look(LIFT_OFF_S + 41.0)
    faults.release()
    node.popen.terminate()
    assert node.popen.wait(10.0) == -15


def test_a_process_that_is_not_there_is_no_matter(tmp_path):
    faults_of("encoder@40", None, tmp_path).look(LIFT_OFF_S + 41.0)
    assert not (tmp_path / FILE).exists()
