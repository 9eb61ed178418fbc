"""A mission of two robots as a process of its own, over mocks of both in namespaces of one domain.

They have the same skillsets, and clocks that are far apart.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from alula.common.record import DECISIONS, EVENTS, read_record
from alula.common.run_log import account

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
    from rosgraph_msgs.msg import Clock as Tick

    from skillset_ros2.session import Session

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
    # All times are the mission's: the robots' clocks can't be compared.
    stamps = [one.stamp_ns for one in record if one.topic == EVENTS]
    assert stamps == sorted(stamps)
    assert min(stamps) > 1e9 * 1e9, "the system's clock"
    assert {one.value["skillset"] for one in record if one.topic == DECISIONS} == {"one_navigation", "two_navigation"}
