"""Managers in a process of their own that is ended, killed, stopped and restarted: no client waits for ever."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import rospy
from skillset_interfaces.srv import Transition
from skillset_ros1_bench import SOON_S

from alula.model.execution_state import ExecutionState
from alula_testing.waits import until
from skillset_ros1 import SkillsetClient

S = ExecutionState
NUMBERS = itertools.count()
PROCESS = Path(__file__).parent / "skillset_ros1_process.py"


class Served:
    """Managers in processes of a namespace, and a client in this one."""

    def __init__(self) -> None:
        self.namespace = f"/p{next(NUMBERS)}"
        self.processes: list[subprocess.Popen[str]] = []
        self.client = SkillsetClient("navigation", namespace=self.namespace)

    def start(self) -> subprocess.Popen[str]:
        process = subprocess.Popen([sys.executable, str(PROCESS), f"__ns:={self.namespace}"], stdout=subprocess.PIPE, text=True)
        self.processes.append(process)
        return process

    def take_off(self):
        assert self.client.wait_ready(SOON_S)
        transition = rospy.ServiceProxy(f"{self.namespace}/navigation/transition", Transition)
        for resource, state in {"SDK_authority": "AVAILABLE", "homepoint_status": "VALID"}.items():
            assert transition(resource, state, "").accepted
        handle = self.client.start("takeoff", height=3, speed=1)
        until(lambda: handle.state is S.RUNNING, f"takeoff runs, it is {handle}: {handle.message}")
        return handle

    def close(self) -> None:
        self.client.close()
        for process in self.processes:
            process.kill()
            process.wait()
            process.stdout.close()


@pytest.fixture
def served(ros_master):
    bench = Served()
    yield bench
    bench.close()


def test_managers_that_are_ended_tell_their_callers_and_stop_their_functions(served):
    process = served.start()
    handle = served.take_off()
    process.send_signal(signal.SIGTERM)
    assert handle.wait(SOON_S)
    assert (handle.state, handle.message) == (S.FAILED, "the managers were shut down")
    assert process.wait(SOON_S) == 0
    assert process.stdout.read() == "stopped takeoff: the managers were shut down\n"
    until(lambda: not served.client.ready, "the client notices")
    assert served.client.start("takeoff", height=3, speed=1).message == "the managers of navigation are not there"


def test_killed_managers_and_those_that_follow_them(served):
    first = served.start()
    handle = served.take_off()
    first.kill()
    assert handle.wait(SOON_S)
    assert handle.state is S.FAILED
    assert "the managers of navigation have gone" in handle.message
    assert not served.client.ready
    served.start()
    again = served.take_off()
    again.interrupt()
    assert again.wait(SOON_S)
    assert again.state is S.INTERRUPTED


def test_managers_that_are_restarted_at_once_do_not_know_the_execution(served):
    first = served.start()
    handle = served.take_off()
    first.kill()
    served.start()
    assert handle.wait(SOON_S)
    assert handle.state is S.FAILED
    assert "gone" in handle.message or "restarted" in handle.message
    until(lambda: served.client.resources.get("SDK_authority") == "UNAVAILABLE", "the states are those of the new ones")
    assert served.take_off().state is S.RUNNING


def test_managers_that_stand_still_are_given_up(served):
    process = served.start()
    handle = served.take_off()
    os.kill(process.pid, signal.SIGSTOP)
    assert handle.wait(SOON_S)
    assert (handle.state, "have gone" in handle.message) == (S.FAILED, True)
    os.kill(process.pid, signal.SIGCONT)
    until(lambda: served.client.ready, "they are taken up again")
