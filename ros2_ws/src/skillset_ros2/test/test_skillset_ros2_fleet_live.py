"""A mission of two robots as a process of its own, over mocks of both in namespaces of one domain.

They have the same skillsets, and clocks that are far apart.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock as Tick
from std_msgs.msg import Header

from alula.common.record import DECISIONS, EVENTS, read_record
from alula.common.run_log import account
from skillset_ros2.fleet_clock import STALLED_S, FleetClock
from skillset_ros2.names import LATCHED
from skillset_ros2.session import Session

ALULA_ROOT = Path(__file__).resolve().parents[4]
QUICK = """
skills:
  navigation.takeoff: {delay: 0.3, then: [{after: 0.1, set: {navigation.flight_status: IN_AIR}}]}
  navigation.land: {delay: 0.3, then: [{after: 0.1, set: {navigation.flight_status: ON_GROUND}}]}
"""
MISSION = """
<root BTCPP_format="4" main_tree_to_execute="meet">
  <BehaviorTree ID="meet">
    <Sequence name="one after the other">
      <one_navigation.takeoff name="one goes up" height="3.0" speed="2.0"/>
      <ScriptCondition name="it alone" code="one_navigation.flight_status == IN_AIR &amp;&amp; two_navigation.flight_status == ON_GROUND"/>
      <one_navigation.land name="one comes down"/>
      <two_navigation.takeoff name="two goes up" height="3.0" speed="2.0"/>
      <two_navigation.land name="two comes down"/>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="ready">
    <Sequence>
      <Needs name="one is ours" if="one_navigation.SDK_authority == AVAILABLE" otherwise="'one is not ours'"/>
      <Needs name="two is ours" if="two_navigation.SDK_authority == AVAILABLE" otherwise="'two is not ours'"/>
    </Sequence>
  </BehaviorTree>
</root>
"""


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    """Return the folder of a fleet of two drones."""
    folder = tmp_path / "fleet"
    for name, text in {
        "robot.yaml": f"name: fleet\nrobots: {{one: {ALULA_ROOT}, two: {ALULA_ROOT}}}\n",
        "scenarios/meet.yaml": "about: x\nmission: missions/meet.xml\nskillsets: [one_navigation, two_navigation]\n",
        "missions/meet.xml": MISSION,
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


CLOCKS_S = {"one": 5000, "two": 100}
TICK_S = 0.05


@pytest.fixture
def clocks(ros2_domain: int) -> Iterator[None]:
    """Have the clock of each robot run."""
    from rclpy.clock import Clock, ClockType

    session = Session("clocks", domain=ros2_domain)
    ticks = {name: Tick() for name in CLOCKS_S}
    publishers = {name: session.node.create_publisher(Tick, f"/{name}/clock", 10) for name in CLOCKS_S}
    passed = [0.0]

    def tick() -> None:
        passed[0] += TICK_S
        for name, begin_s in CLOCKS_S.items():
            ticks[name].clock.sec, ticks[name].clock.nanosec = begin_s + int(passed[0]), int(passed[0] % 1.0 * 1e9)
            publishers[name].publish(ticks[name])

    session.node.create_timer(TICK_S, tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
    yield
    session.close()


@pytest.fixture
def mocks(clocks: None, tmp_path: Path) -> Iterator[None]:
    """Mock both."""
    (tmp_path / "quick.yaml").write_text(QUICK, encoding="utf-8")
    words = [sys.executable, "-m", "skillset_ros2.mock", str(ALULA_ROOT / "skillsets/uav"), "--skillset", "navigation"]
    words += ["--behaviour", str(tmp_path / "quick.yaml"), "--ros-args", "-p", "use_sim_time:=true"]
    made = [subprocess.Popen([*words, "-r", f"__ns:=/{name}", "-r", f"/clock:=/{name}/clock"], env=dict(os.environ)) for name in CLOCKS_S]
    yield
    for process in made:
        process.kill()
        process.wait()


def test_a_mission_of_two_robots_has_each_do_its_part(mocks: None, fleet: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    command = [sys.executable, "-m", "skillset_ros2.mission", "--scenario", "meet", "--out", str(out), "--ros-args", "-r", "__ns:=/fleet"]
    done = subprocess.run(command, env={**os.environ, "ALULA_ROBOT": str(fleet)}, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    record = list(read_record(out))
    assert account(out, record)["outcome"] == "accomplished"
    ends = [
        (one.value["skillset"], one.value["skill"], one.value["result"])
        for one in record
        if one.topic == EVENTS and one.value.get("state") == "TERMINATED"
    ]
    assert ends == [
        ("one_navigation", "takeoff", "AT_ALTITUDE"),
        ("one_navigation", "land", "LANDED"),
        ("two_navigation", "takeoff", "AT_ALTITUDE"),
        ("two_navigation", "land", "LANDED"),
    ]
    # All times are the mission's, whose clock is not the robots'.
    stamps = [one.stamp_ns for one in record if one.topic == EVENTS]
    assert stamps == sorted(stamps)
    assert min(stamps) > 1e9 * 1e9, "the system's clock"
    assert {one.value["skillset"] for one in record if one.topic == DECISIONS} == {"one_navigation", "two_navigation"}


def test_a_mission_by_the_clocks_of_its_robots_has_those_ahead_wait_for_it(
    mocks: None, fleet: Path, ros2_domain: int, tmp_path: Path
) -> None:
    heard: dict[str, list[int]] = {name: [] for name in CLOCKS_S}
    session = Session("simulators", domain=ros2_domain)
    for name, stamps in heard.items():
        note = lambda header, stamps=stamps: stamps.append(header.stamp.sec)  # noqa: E731
        session.node.create_subscription(Header, f"/{name}/mission/heartbeat", note, LATCHED)
    out, place = tmp_path / "run", ["-r", "__ns:=/fleet", "-r", "/clock:=/fleet/clock", "-p", "use_sim_time:=true"]
    command = [sys.executable, "-m", "skillset_ros2.mission", "--scenario", "meet", "--out", str(out), "--ros-args", *place]
    done = subprocess.run(command, env={**os.environ, "ALULA_ROBOT": str(fleet)}, capture_output=True, text=True, timeout=600, check=False)
    session.close()
    assert done.returncode == 0, done.stdout + done.stderr
    behind = range(min(CLOCKS_S.values()), max(CLOCKS_S.values()))
    record = list(read_record(out))
    assert all(one.stamp_ns // 10**9 in behind for one in record if one.topic == DECISIONS)
    assert all(one.stamp_ns // 10**9 in behind or one.stamp_ns == 0 for one in record if one.topic == EVENTS)  # 0: before it had begun
    for stamps in heard.values():
        assert stamps, "simulators wait for heartbeats"
        assert all(stamp in behind or stamp == 0 for stamp in stamps)
        assert stamps == sorted(stamps)


class Clocks:
    """The clock of a fleet of two, and what it has said."""

    def __init__(self, domain: int) -> None:
        self.session = Session("fleet", domain=domain)
        self.node = self.session.node
        self.said: list[int] = []
        self.wall_s = 0.0
        self.fleet = FleetClock(self.node, ["/one", "/two"], lambda: self.wall_s)
        self.node.create_subscription(Tick, "clock", lambda tick: self.said.append(tick.clock.sec), 10)
        self.robots = {name: self.node.create_publisher(Tick, f"/{name}/clock", 10) for name in ("one", "two")}

    def tell(self, heard: int, **ticks: int) -> None:
        """Publish the clocks of robots until this is the last that the fleet's has said."""
        while self.said[-1:] != [heard]:
            for name, sec in ticks.items():
                self.robots[name].publish(Tick(clock=Time(sec=sec)))
            self.fleet.look()
            time.sleep(0.01)


def test_the_clock_of_a_fleet_is_that_of_the_robot_furthest_behind(ros2_domain: int) -> None:
    clocks = Clocks(ros2_domain)
    clocks.tell(3, one=5, two=3)
    clocks.tell(4, one=6, two=4)
    clocks.tell(6, one=6, two=9)
    assert clocks.said == sorted(clocks.said)
    # One that has ended holds nobody up.
    clocks.node.destroy_publisher(clocks.robots.pop("one"))
    clocks.tell(11, two=11)
    clocks.session.close()


def test_a_robot_whose_clock_stands_still_holds_the_clock_of_the_fleet_for_a_while(ros2_domain: int) -> None:
    clocks = Clocks(ros2_domain)
    clocks.tell(3, one=4, two=3)
    clocks.wall_s = STALLED_S - 1.0
    clocks.fleet.look()  # the second stalls, the first waits for the mission
    clocks.tell(4, one=5, two=4)
    clocks.wall_s += STALLED_S + 1.0
    assert clocks.said[-1] == 4
    clocks.tell(5, one=5)
    assert 4 in clocks.said
    clocks.tell(7, one=7)
    # Once it goes on it is waited for until it has caught up.
    clocks.tell(8, one=8, two=8)
    clocks.tell(9, one=12, two=9)
    # When all stand still none is left out.
    clocks.wall_s += STALLED_S + 1.0
    clocks.fleet.look()
    clocks.tell(13, one=13, two=13)
    assert clocks.said == sorted(clocks.said)
    clocks.session.close()
