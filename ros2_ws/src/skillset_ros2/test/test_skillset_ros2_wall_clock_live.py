"""Managers in a process whose wall clock is set by an hour, as NTP may do in the middle of a mission."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("navigation_interfaces.action")

from rclpy.context import Context  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from skillset_interfaces.msg import Heartbeat  # noqa: E402
from skillset_ros2_rig import READY_S, until  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from alula.common.fast_dds import PROFILE_VARIABLES, leave  # noqa: E402
from alula.common.network import claim_domain  # noqa: E402
from alula.common.shared_memory import sweep_shared_memory  # noqa: E402
from alula.common.steady_clock import STEADY_CLOCK  # noqa: E402
from alula.model.execution_state import ExecutionState  # noqa: E402
from alula.runtime.codecs import stamp_ns_of  # noqa: E402
from alula_testing.wall_clock import WallClock  # noqa: E402
from skillset_ros2 import SkillsetClient  # noqa: E402
from skillset_ros2.names import ALIVE  # noqa: E402

HOUR_S = 3600
LONG_S = 30.0  # for what takes two seconds on an idle machine, and would take an hour
STEPS = {"forward": HOUR_S, "back": -HOUR_S}
S = ExecutionState


WORDS = [sys.executable, str(Path(__file__).with_name("skillset_ros2_stepped.py"))]


def without_shared_memory(folder: Path) -> dict[str, str]:
    """Return the variables of a process that leaves no times of its clock in the shared memory of this one's participant."""
    usual = Path(os.environ[PROFILE_VARIABLES[0]]).read_text(encoding="utf-8")
    profile = folder / "udp.xml"
    profile.write_text(usual.replace("<transport_id>alula_shm</transport_id>\n          <", "<"), encoding="utf-8")
    return dict.fromkeys(PROFILE_VARIABLES, str(profile))


class Stepped:
    """The managers' process, what it says, and a client on another clock."""

    def __init__(self, spinning, folder: Path) -> None:
        self.clock = WallClock(folder)
        words = [*WORDS, "--ros-args", "-p", "interrupt_timeout_s:=2.0"]
        environment = {**self.clock.environment, **without_shared_memory(folder)}
        self.process = subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True)
        self.told: list[str] = []
        self.reader = threading.Thread(target=lambda: self.told.extend(map(str.strip, self.process.stdout)), daemon=True)
        self.reader.start()
        self.node = Node("stepped_tester")
        self.client = SkillsetClient(self.node, "navigation")
        self.events: list = []
        self.client.on_event(self.events.append)
        self.beats: list[tuple[float, float]] = []
        self.node.create_subscription(Heartbeat, "navigation/alive", self._hear, ALIVE)
        spinning.spin(self.node)

    def _hear(self, heartbeat) -> None:
        self.beats.append((stamp_ns_of(heartbeat.header.stamp) / 1e9, heartbeat.begun_ns / 1e9))

    def take_off(self):
        for resource, state in {"SDK_authority": "AVAILABLE", "homepoint_status": "VALID"}.items():
            assert self.client.transition(resource, state).get(LONG_S).accepted
        handle = self.client.start("takeoff", height=3.0, speed=1.0)
        until(lambda: handle.state is S.RUNNING, f"takeoff runs, it is {handle}: {handle.message}")
        return handle

    def goes_on(self, word: str, times: int = 6) -> None:
        """Wait until the process has said a word so often again."""
        wanted = self.told.count(word) + times
        until(lambda: self.told.count(word) >= wanted, f"{word} is told {times} times", LONG_S)

    def close(self) -> None:
        self.process.terminate()
        self.process.wait(LONG_S)
        self.reader.join()
        self.process.stdout.close()


@pytest.fixture
def stepped(spinning, tmp_path):
    bench = Stepped(spinning, tmp_path)
    try:
        assert bench.client.wait_ready(READY_S), bench.client.missing
        yield bench
    finally:
        bench.close()


@pytest.mark.parametrize("by_s", STEPS.values(), ids=STEPS)
def test_a_wall_clock_that_is_set_by_an_hour_ends_nothing_and_delays_nothing(stepped, by_s):
    handle = stepped.take_off()
    stepped.goes_on("progress")
    begun_s, happened = stepped.beats[-1][1], len(stepped.events)
    stepped.clock.step(by_s)
    stepped.goes_on("progress")
    stepped.goes_on("look", times=15)  # of 0.2 s: longer than the silence of the resource
    assert (handle.state, stepped.client.resources["SDK_authority"]) == (S.RUNNING, "AVAILABLE")
    assert len(stepped.events) == happened, stepped.events[happened:]

    # What is published is wall time, as it is set now; so is when the managers began.
    stepped.beats.clear()
    until(lambda: stepped.beats, "a heartbeat comes", LONG_S)
    sent_s, now_begun_s = stepped.beats[-1]
    assert abs(sent_s - by_s - time.time()) < LONG_S  # noqa: TID251 - it compares wall clocks
    assert now_begun_s - begun_s == pytest.approx(by_s, abs=0.05)

    # What has to end by itself does: an interruption that the hook never confirms, and the belief in a reporter that is silent.
    handle.interrupt()
    assert handle.wait(LONG_S)
    # To this client they are on another computer by now: their stamps are corrected by what their heartbeats have told.
    assert abs(stepped.events[-1].stamp_ns - STEADY_CLOCK.now_ns()) < LONG_S * 1e9
    stepped.process.send_signal(signal.SIGUSR1)
    until(lambda: stepped.client.resources["SDK_authority"] == "UNAVAILABLE", "it is unknown", LONG_S)
    assert stepped.client.reasons["SDK_authority"].startswith("not heard of for ")


@pytest.mark.parametrize("by_s", STEPS.values(), ids=STEPS)
def test_a_silence_that_has_begun_is_noticed_when_the_clock_is_set_meanwhile(stepped, by_s):
    handle = stepped.take_off()
    stepped.goes_on("look", times=5)
    stepped.process.send_signal(signal.SIGUSR1)
    stepped.clock.step(by_s)
    assert handle.wait(LONG_S)
    assert handle.outcome == "RESOURCE_INVARIANT_VIOLATED"


SERVER = """
import rclpy
from std_srvs.srv import Trigger
rclpy.init()
node = rclpy.create_node("server")
node.create_service(Trigger, "reach", lambda request, answer: answer)
rclpy.spin(node)
"""


@pytest.fixture
def survivor():
    """Return a node in a context and a domain of its own."""
    claim = claim_domain()
    context = Context()
    rclpy.init(context=context, domain_id=claim.domain)
    node = Node("survivor", context=context)
    yield node
    leave(node)
    claim.release()


def test_after_a_clock_was_set_back_who_is_started_for_one_that_was_killed_is_reached(survivor, tmp_path):
    executor = SingleThreadedExecutor(context=survivor.context)
    executor.add_node(survivor)
    client = survivor.create_client(Trigger, "reach")
    environment = {**os.environ, "ROS_DOMAIN_ID": str(survivor.context.get_domain_id())}

    def is_answered() -> bool:
        asked = client.call_async(Trigger.Request())
        executor.spin_until_future_complete(asked, timeout_sec=1.0)
        return asked.done()

    clock = WallClock(tmp_path)
    clock.step(HOUR_S)
    for variables in (clock.variables, {}):
        server = subprocess.Popen([sys.executable, "-c", SERVER], env={**environment, **variables})
        try:
            until(is_answered, "the server is reached", READY_S)
        finally:
            server.kill()
            server.wait()
        sweep_shared_memory()
    survivor.destroy_client(client)
