"""Managers in a process whose wall clock is set by an hour, as NTP may do in the middle of a mission."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("navigation_interfaces.action")

from rclpy.node import Node  # noqa: E402
from skillset_interfaces.msg import Heartbeat  # noqa: E402
from skillset_ros2_rig import READY_S, until  # noqa: E402

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


class Stepped:
    """The managers' process, what it says, and a client on another clock."""

    def __init__(self, spinning, folder: Path) -> None:
        self.clock = WallClock(folder)
        words = [sys.executable, str(Path(__file__).with_name("skillset_ros2_stepped.py")), "--ros-args", "-p", "interrupt_timeout_s:=2.0"]
        self.process = subprocess.Popen(words, env=self.clock.environment, stdout=subprocess.PIPE, text=True)
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
