"""Managers in a process whose wall clock is set by an hour, as NTP may do in the middle of a mission."""

from __future__ import annotations

import itertools
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import rospy
from skillset_interfaces.msg import Heartbeat, ResourceState, ResourceStates
from skillset_ros1_bench import SOON_S

from alula.common.steady_clock import STEADY_CLOCK
from alula.model.execution_state import ExecutionState
from alula.runtime.codecs import stamp_ns_of
from alula_testing.waits import until
from alula_testing.wall_clock import WallClock
from skillset_ros1 import SkillsetClient

HOUR_S = 3600
LONG_S = 30.0  # for what takes two seconds on an idle machine, and would take an hour
BEAT_S = 0.25
STEPS = {"forward": HOUR_S, "back": -HOUR_S}
NUMBERS = itertools.count()
S = ExecutionState


class Stepped:
    """The managers' process, what it says, a reporter of SDK_authority, and a client on another clock."""

    def __init__(self, folder: Path) -> None:
        self.clock, self.namespace = WallClock(folder), f"/stepped{next(NUMBERS)}"
        words = [sys.executable, str(Path(__file__).with_name("skillset_ros1_stepped.py"))]
        words += [f"__ns:={self.namespace}", "_interrupt_timeout_s:=2.0"]
        self.process = subprocess.Popen(words, env=self.clock.environment, stdout=subprocess.PIPE, text=True)
        self.told: list[str] = []
        self._reader = threading.Thread(target=lambda: self.told.extend(map(str.strip, self.process.stdout)), daemon=True)
        self._reader.start()
        self.client = SkillsetClient("navigation", namespace=self.namespace)
        self.events: list = []
        self.client.on_event(self.events.append)
        self.beats: list[tuple[float, float]] = []
        self._alive = rospy.Subscriber(f"{self.namespace}/navigation/alive", Heartbeat, self._hear)
        self._reporter = rospy.Publisher(f"{self.namespace}/navigation/reported", ResourceStates, queue_size=1)
        self._reported = ResourceStates(skillset="navigation", resources=[ResourceState(name="SDK_authority", state="AVAILABLE")])
        self._reports = rospy.Timer(rospy.Duration.from_sec(BEAT_S), lambda _: self._reporter.publish(self._reported))

    def _hear(self, heartbeat) -> None:
        self.beats.append((stamp_ns_of(heartbeat.header.stamp) / 1e9, heartbeat.begun_ns / 1e9))

    def take_off(self):
        for resource, state in {"SDK_authority": "AVAILABLE", "homepoint_status": "VALID"}.items():
            assert self.client.transition(resource, state).get(LONG_S).accepted
        handle = self.client.start("takeoff", height=3, speed=1)
        until(lambda: handle.state is S.RUNNING, f"takeoff runs, it is {handle}: {handle.message}")
        until(self._reporter.get_num_connections, "its reporter is heard")
        return handle

    def goes_on(self, times: int) -> None:
        """Wait until the process has told of so many progresses again; the model has one every half second."""
        wanted = len(self.told) + times
        until(lambda: len(self.told) >= wanted, f"progress is told {times} times", LONG_S)

    def fall_silent(self) -> None:
        """Report nothing more."""
        self._reports.shutdown()

    def close(self) -> None:
        self._reports.shutdown()
        self.client.close()
        self._alive.unregister()
        self._reporter.unregister()
        self.process.kill()
        self.process.wait()
        self._reader.join()
        self.process.stdout.close()


@pytest.fixture
def stepped(ros_master, tmp_path):
    bench = Stepped(tmp_path)
    try:
        assert bench.client.wait_ready(SOON_S)
        yield bench
    finally:
        bench.close()


@pytest.mark.parametrize("by_s", STEPS.values(), ids=STEPS)
def test_a_wall_clock_that_is_set_by_an_hour_ends_nothing_and_delays_nothing(stepped, by_s):
    handle = stepped.take_off()
    stepped.goes_on(3)
    begun_s, happened = stepped.beats[-1][1], len(stepped.events)
    stepped.clock.step(by_s)
    stepped.goes_on(6)
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
    stepped.fall_silent()
    until(lambda: stepped.client.resources["SDK_authority"] == "UNAVAILABLE", "it is unknown", LONG_S)
    assert stepped.client.reasons["SDK_authority"].startswith("not heard of for ")


@pytest.mark.parametrize("by_s", STEPS.values(), ids=STEPS)
def test_a_silence_that_has_begun_is_noticed_when_the_clock_is_set_meanwhile(stepped, by_s):
    handle = stepped.take_off()
    stepped.goes_on(2)
    stepped.fall_silent()
    stepped.clock.step(by_s)
    assert handle.wait(LONG_S)
    assert handle.outcome == "RESOURCE_INVARIANT_VIOLATED"
