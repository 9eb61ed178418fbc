"""The real mission over mocks: it does what it does in the simulator, in no time, and campaigns of hundreds hold what they promise."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from alula.cli import run as over_mocks
from alula.common import run_log
from alula.common.faults import FaultRequest
from alula.common.record import BLACKBOARD, DECISIONS, EVENTS, MISSION, REPORTS, TREE, read_record
from alula.common.scenarios import load_scenario
from alula.missions.director import Outcome
from alula.missions.mocked import MockedMission
from alula.missions.scenario import plan_of
from alula.mock import load_behaviour
from alula.records.models import robot_skillsets
from alula.runtime.core import ExecutionEvent
from uav_missions.route import inputs_of, route_of

ALULA_ROOT = Path(__file__).resolve().parents[4]
INPUTS = inputs_of(ALULA_ROOT / "ros1_ws/src/uav_simulator/worlds/yard.yaml")
ROUTE = route_of(INPUTS).waypoints
PLAN = plan_of(load_scenario("mapping"), INPUTS)
SKILLSETS = robot_skillsets(("navigation", "perception", "mapping"))
BEHAVIOUR = load_behaviour([ALULA_ROOT / "skillsets/uav/mock.yaml"], robot_skillsets()).of(frozenset(s.name for s in SKILLSETS))

# What `./alula fly mapping --rate 0 --fail zed@30` recorded in the simulator, in the order of the requests.
SIMULATED = [
    ("takeoff", "TERMINATED", "AT_ALTITUDE"),
    ("zed_depthmap", "RESOURCE_INVARIANT_VIOLATED", "zed_ok"),
    ("lidar_mapping", "INTERRUPTED", ""),
    ("goto_straight", "TERMINATED", "ARRIVED"),
    ("goto_straight", "TERMINATED", "ARRIVED"),
    ("goto_straight", "INTERRUPTED", ""),
    ("lidar_depthmap", "INTERRUPTED", ""),
    ("rotate_head", "TERMINATED", "ALIGNED"),
    ("lock_head", "INTERRUPTED", ""),
    ("goto", "TERMINATED", "ARRIVED"),
    ("rotate_head", "TERMINATED", "ALIGNED"),
    ("lock_head", "INTERRUPTED", ""),
    ("goto", "TERMINATED", "ARRIVED"),
    ("rotate_head", "TERMINATED", "ALIGNED"),
    ("lock_head", "INTERRUPTED", ""),
    ("goto", "TERMINATED", "ARRIVED"),
    ("land", "TERMINATED", "LANDED"),
]
SIDE_BY_SIDE = {"zed_depthmap", "lidar_mapping"}  # two skillsets are asked in one tick: over a network either may be first


def make(*faults: FaultRequest, **options) -> MockedMission:
    return MockedMission(SKILLSETS, BEHAVIOUR, PLAN, faults=faults, **options)


def landed(mission: MockedMission) -> bool:
    return mission.state("navigation", "flight_status") == "ON_GROUND"


def executions(mission: MockedMission) -> list[tuple[str, str, str]]:
    """Return skill, outcome and result of each execution in the order of the requests."""
    found: dict[str, tuple[str, str, str]] = {}
    for event in mission.events:
        if isinstance(event, ExecutionEvent):
            found[event.id] = (event.skill, event.state.value, event.result)
    return list(found.values())


def ends(mission: MockedMission) -> Counter:
    return Counter(event.id for event in mission.events if isinstance(event, ExecutionEvent) and event.state.terminal)


def comparable(story: list[tuple[str, str, str]]) -> list[object]:
    """Put what is asked for side by side into one set."""
    beside = [entry for entry in story if entry[0] in SIDE_BY_SIDE]
    rest: list[object] = [entry for entry in story if entry[0] not in SIDE_BY_SIDE]
    return [rest[0], set(beside), *rest[1:]]


def test_losing_the_zed_is_flown_as_in_the_simulator():
    mission = make(FaultRequest("zed", begin_s=30.0))
    assert mission.run().outcome is Outcome.DEGRADED
    assert comparable(executions(mission)) == comparable(SIMULATED)
    lift_off_ns = next(event.stamp_ns for event in mission.events if getattr(event, "to_state", "") == "IN_AIR")
    lost_ns = next(event.stamp_ns for event in mission.events if getattr(event, "to_state", "") == "BROKEN")
    watching_ns = next(
        event.stamp_ns for event in mission.events if getattr(event, "skill", "") == "lidar_depthmap" and event.state.value == "RUNNING"
    )
    assert (lost_ns - lift_off_ns) / 1e9 == pytest.approx(30.34, abs=0.05)
    assert 0.0 < (watching_ns - lost_ns) / 1e9 < 0.2


def test_a_nominal_flight_is_accomplished_in_the_time_that_it_takes_in_the_simulator():
    mission = make()
    assert mission.run().outcome is Outcome.ACCOMPLISHED
    assert [skill for skill, _, _ in executions(mission)].count("goto_straight") == len(ROUTE)
    assert 90.0 < mission.world.now_s < 110.0  # 99 s from lift-off in the simulator, 4.5 s before
    assert landed(mission)
    assert mission.open_executions == []


def test_both_sensors_dead_is_given_up_and_landed():
    mission = make(FaultRequest("zed", begin_s=8.0), FaultRequest("lidar", begin_s=8.0))
    end = mission.run()
    assert end.outcome is Outcome.GIVEN_UP
    assert "zed_ok" in end.reason
    assert [skill for skill, _, _ in executions(mission)][-3:] == ["lidar_depthmap", "hover", "land"]
    assert landed(mission)


def test_a_lidar_that_is_broken_from_the_start_keeps_the_mission_on_the_ground():
    mission = make(FaultRequest("lidar"))
    end = mission.run()
    assert end.outcome is Outcome.NOT_STARTED
    assert "LiDAR is broken" in end.reason
    assert executions(mission) == []


def test_an_abort_lands_first():
    mission = make()
    mission.world.clock.after(20.0, lambda: mission.abort("operator"))
    end = mission.run()
    assert (end.outcome, end.reason) == (Outcome.ABORTED, "operator")
    assert executions(mission)[-1] == ("land", "TERMINATED", "LANDED")


def test_the_same_seed_flies_the_same_flight():
    first, second = make(FaultRequest("zed", begin_s=40.0), seed=5), make(FaultRequest("zed", begin_s=40.0), seed=5)
    first.run()
    second.run()
    assert first.events == second.events


def test_a_campaign_always_comes_to_an_end_and_down():
    """Seeds, failures of sensors at random times, and functions that fail by chance on top."""
    troubles = load_behaviour(
        [ALULA_ROOT / "skillsets/uav/mock.yaml", Path(__file__).with_name("uav_missions_troubles.yaml")],
        robot_skillsets(),
    ).of(frozenset(s.name for s in SKILLSETS))
    outcomes: Counter[Outcome] = Counter()
    for seed in range(100):
        chance = random.Random(seed)  # noqa: S311 - no secret
        faults = [FaultRequest(name, begin_s=chance.uniform(0.0, 110.0)) for name in chance.sample(["zed", "lidar"], chance.randint(0, 2))]
        mission = MockedMission(SKILLSETS, troubles, PLAN, faults=faults, seed=seed, tick_period_s=1.0)
        outcomes[mission.run().outcome] += 1
        assert landed(mission), seed
        assert mission.open_executions == [], seed
        assert set(ends(mission).values()) <= {1}, seed
        assert mission.world.errors == [], seed
        assert mission.robot.host.notes == [], seed
    assert set(outcomes) == {Outcome.ACCOMPLISHED, Outcome.DEGRADED, Outcome.GIVEN_UP}
    assert min(outcomes.values()) > 5


# What a mapping flight asks for whose sensors both fail on the second leg.
WITHOUT_EYES = [
    "start takeoff",
    "start lidar_mapping",
    "start zed_depthmap",
    "start goto_straight",
    "start goto_straight",
    "interrupt goto_straight",
    "start lidar_depthmap",
    "interrupt lidar_mapping",
    "start hover",
    "start land",
]


def arguments(out: Path, *more: str) -> list[str]:
    return ["mapping", "--mock", "--out", str(out), *more]


def test_a_flight_without_eyes_ends_1_and_leaves_its_record(tmp_path):
    assert over_mocks.main(arguments(tmp_path / "run", "--fail", "zed@8", "--fail", "lidar@8")) == 1
    mission = run_log.account(tmp_path / "run", read_record(tmp_path / "run"))
    assert (mission["outcome"], mission["waypoints_reached"]) == ("given_up", 1)
    record = read_record(tmp_path / "run")
    events = [entry.value for entry in record if entry.topic == EVENTS]
    for skillset in ("navigation", "perception", "mapping"):
        numbers = [event["sequence"] for event in events if event["skillset"] == skillset]
        assert numbers == list(range(1, len(numbers) + 1))
    told = [(fault["sensor"], round(fault["t_s"] - mission["lift_off_s"], 2)) for fault in run_log.read(tmp_path / "run", run_log.FAULT)]
    assert told == [("zed", 8.0), ("lidar", 8.0)]
    assert [mocked["notes"] for mocked in run_log.read(tmp_path / "run", run_log.MOCKED)] == [[]]
    assert (tmp_path / "run/tree.svg").read_text().startswith("<svg")
    assert [entry.value for entry in record if entry.topic == TREE][-1]["status"] == "FAILURE"
    assert [entry.value["outcome"] for entry in record if entry.topic == MISSION] == ["running", "given_up"]
    assert [entry.value for entry in record if entry.topic == MISSION][-1] == mission
    decisions = [entry.value for entry in record if entry.topic == DECISIONS]
    assert [decision["number"] for decision in decisions] == list(range(1, len(decisions) + 1))
    assert [f"{decision['kind']} {decision['skill']}" for decision in decisions] == WITHOUT_EYES
    assert decisions[0]["inputs"] == {"height": 3.0, "speed": 2.0}
    requested = [event["id"] for event in events if event.get("state") == "REQUESTED"]
    assert [decision["id"] for decision in decisions if decision["kind"] == "start"] == requested
    ends = {entry.value["id"]: entry.value["state"] for entry in record if entry.topic == REPORTS}
    assert ends == {event["id"]: event["state"] for event in events if event["kind"] == "EXECUTION"}
    assert {name for entry in record if entry.topic == BLACKBOARD for name in entry.value} >= {"failures", "reason", "waypoint"}


def test_a_full_disk_ends_the_record_and_not_the_flight(tmp_path):
    (tmp_path / "skills.mcap").symlink_to("/dev/full")
    assert MockedMission(SKILLSETS, BEHAVIOUR, PLAN, out=tmp_path).run().outcome is Outcome.ACCOMPLISHED
    mission = run_log.account(tmp_path, [])
    assert mission["outcome"] == "accomplished"
    assert mission["problems"] == ["skills.mcap ends early: No space left on device"]


def test_a_folder_that_goes_away_in_flight_does_not_end_it(tmp_path):
    out = tmp_path / "run"
    out.mkdir()
    mission = MockedMission(SKILLSETS, BEHAVIOUR, PLAN, out=out)
    mission.world.clock.after(20.0, lambda: shutil.rmtree(out))
    assert mission.run().outcome is Outcome.ACCOMPLISHED
    assert not out.exists()


def test_a_wrong_request_ends_2_and_writes_nothing(tmp_path, capsys):
    assert over_mocks.main(arguments(tmp_path / "run", "--fail", "imu@8")) == 2
    assert capsys.readouterr().err == "alula run: there is no fault 'imu' in the behaviour; it has zed, lidar, pilot, control\n"
    assert not (tmp_path / "run").exists()


def test_no_ros_is_needed(tmp_path):
    code = (
        "import sys; from alula.cli.run import main; code = main(sys.argv[1:]);"
        "assert not {m for m in sys.modules if m.startswith(('rclpy', 'rospy', 'geometry_msgs'))}; sys.exit(code)"
    )
    subprocess.run([sys.executable, "-c", code, *arguments(tmp_path / "run")], check=True, env=dict(os.environ), timeout=60)
