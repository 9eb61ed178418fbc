"""A pytest plugin for the ROS 1 world: ``ros_master`` and ``start_node``."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from xmlrpc.client import ServerProxy

import pytest

from alula.common.network import free_port
from alula_testing.waits import until

StartNode = Callable[..., "subprocess.Popen[bytes]"]
END_WITH_PARENT = ("setpriv", "--pdeathsig", "TERM")
"""Of util-linux: the command ends with the thread that started it, also where tests are killed."""


def end_process(process: subprocess.Popen[bytes], *, timeout_s: float = 5.0) -> None:
    """End a process group that the test started: first politely, then for good."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def refusal_of_node(command: Sequence[str], master: str) -> str:
    """Run a node that can't start, to its end, and return the one line in which it says why; fail where it ends otherwise."""
    env = {**os.environ, "ROS_MASTER_URI": master}
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), f"ended with {done.returncode}: {done.stderr}"
    return done.stderr


@contextmanager
def running_master(node: str) -> Iterator[str]:
    """Run a ROS master on a port of its own, with this process as a node of it, and return its URI."""
    import rospy

    port = free_port()
    uri = f"http://127.0.0.1:{port}"
    os.environ["ROS_MASTER_URI"] = uri
    os.environ["ROS_IP"] = "127.0.0.1"
    master = subprocess.Popen([*END_WITH_PARENT, "rosmaster", "--core", "-p", str(port)], start_new_session=True, stdout=subprocess.DEVNULL)

    def answers() -> bool:
        try:
            ServerProxy(uri).getPid(f"/{node}")
        except OSError:
            return False
        return True

    try:
        until(answers, what="the ROS master answers")
        rospy.init_node(node, disable_signals=True)
        yield uri
    finally:
        rospy.signal_shutdown("that was all")
        end_process(master)


@pytest.fixture(scope="session")
def ros_master() -> Iterator[str]:
    """Start a ROS master on a port of its own; this process becomes node /tester, on wall time unless a test sets /use_sim_time before."""
    with running_master("tester") as uri:
        yield uri


@pytest.fixture(autouse=True)
def parameters_as_before(request: pytest.FixtureRequest) -> Iterator[None]:
    """Take the parameters that came with a test off the master: those of a node outlive it, for the next one of its name to read."""
    if "ros_master" not in request.fixturenames:
        yield
        return
    master = ServerProxy(request.getfixturevalue("ros_master"))
    before = set(master.getParamNames("/tester")[2])
    yield
    for name in set(master.getParamNames("/tester")[2]) - before:
        master.deleteParam("/tester", name)


@pytest.fixture
def start_node(ros_master: str) -> Iterator[StartNode]:
    """Return a function that starts a node's executable (a list of words, remappings and ``_private:=`` parameters included)."""
    running: list[subprocess.Popen[bytes]] = []

    def start(command: list[str]) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(command, start_new_session=True, env={**os.environ, "ROS_MASTER_URI": ros_master})
        running.append(process)
        return process

    yield start
    for process in running:
        end_process(process)
