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

from alula import AlulaError, Mission, MockedMission, Outcome, Run, open_run, parts
from uav_missions.route import route_of

MISSION = Mission.load("mapping")
ROUTE = route_of(MISSION.plan.inputs).waypoints

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


def make(*faults: str, **options) -> MockedMission:
    return MISSION.mocked(*faults, **options)


def landed(mission: MockedMission) -> bool:
    return mission.state("navigation", "flight_status") == "ON_GROUND"


def executions(mission: MockedMission) -> list[tuple[str, str, str]]:
    """Return skill, outcome and result of each execution in the order of the requests."""
    return [(one.skill, one.state.value, one.result) for one in mission.executions]


def ends(mission: MockedMission) -> Counter:
    return Counter(event.id for event in mission.ended)


def comparable(story: list[tuple[str, str, str]]) -> list[object]:
    """Put what is asked for side by side into one set."""
    beside = [entry for entry in story if entry[0] in SIDE_BY_SIDE]
    rest: list[object] = [entry for entry in story if entry[0] not in SIDE_BY_SIDE]
    return [rest[0], set(beside), *rest[1:]]


def test_losing_the_zed_is_flown_as_in_the_simulator():
    mission = make("zed@30")
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


def test_a_barometer_that_drifts_is_flown_by_the_maps_height_and_said():
    mission = make("barometer@8")
    end = mission.run()
    assert (end.outcome, end.reason) == (Outcome.DEGRADED, "the barometer drifted, flown by the map's height")
    assert [skill for skill, _, _ in executions(mission)].count("goto_straight") == len(ROUTE)
    assert landed(mission)
    both = make("barometer@8", "zed@30").run()
    assert both.outcome is Outcome.DEGRADED
    assert "zed_ok" in both.reason
    assert both.reason.endswith("; then the barometer drifted, flown by the map's height")


def test_heights_that_nobody_can_believe_any_more_end_the_map_and_the_flight():
    mission = make("barometer:wrong@8")
    end = mission.run()
    assert end.outcome is Outcome.GIVEN_UP
    assert "height_known" in end.reason
    assert [skill for skill, _, _ in executions(mission)][-2:] == ["hover", "land"]
    assert landed(mission)


def test_a_position_that_is_lost_is_landed_at_once_without_a_hover():
    for at_s, motion in ((10, "goto_straight"), (50, "rotate_head"), (55, "goto")):
        mission = make(f"gps@{at_s}", "zed@30")
        end = mission.run()
        assert end.outcome is Outcome.GIVEN_UP
        assert "keep_position" in end.reason
        asked = executions(mission)
        assert (motion, "RESOURCE_INVARIANT_VIOLATED", "keep_position") in asked
        assert asked[-2:] == [("hover", "NOT_READY", "position_known"), ("land", "TERMINATED", "LANDED")]
        lost_ns, landing_ns = (
            next(event.stamp_ns for event in mission.events if getattr(event, "to_state", "") == "LOST"),
            next(event.stamp_ns for event in mission.events if getattr(event, "skill", "") == "land"),
        )
        assert 0.0 <= (landing_ns - lost_ns) / 1e9 <= 0.3, "s; the autopilot's failsafe comes 7 s after this"
        assert landed(mission)


def test_a_position_that_is_not_known_keeps_the_mission_on_the_ground():
    mission = make("gps")
    end = mission.run()
    assert end.outcome is Outcome.NOT_STARTED
    assert "the position is not known" in end.reason


@pytest.mark.parametrize(
    ("fault", "at_s", "motion"),
    [("link", 10, "goto_straight"), ("link", 48.8, "rotate_head"), ("link", 55, "goto"), ("link:silent", 10, "goto_straight")],
)
def test_a_lost_link_ends_the_legs_and_what_is_in_the_air_is_landed_once_the_vehicle_is_heard_of(fault, at_s, motion):
    away_s = 12.0
    mission = make(f"{fault}@{at_s:g}-{at_s + away_s:g}", "zed@30")
    end = mission.run()
    assert end.outcome is Outcome.GIVEN_UP
    assert f"navigation.{motion}: RESOURCE_INVARIANT_VIOLATED keep_link" in end.reason
    assert (motion, "RESOURCE_INVARIANT_VIOLATED", "keep_link") in executions(mission)
    assert executions(mission)[-2:] == [("hover", "TERMINATED", "DONE"), ("land", "TERMINATED", "LANDED")]
    states = {event.to_state: event.stamp_ns / 1e9 for event in mission.events if getattr(event, "resource", "") == "link"}
    lost_s, back_s = states["DOWN" if fault == "link" else "UNKNOWN"], states["UP"]
    asked_s = [event.stamp_ns / 1e9 for event in mission.events if getattr(event, "skill", "") and event.state.value == "REQUESTED"]
    assert back_s - lost_s == pytest.approx(away_s)
    assert [one for one in asked_s if lost_s < one < back_s] == [], "nothing is asked of a vehicle that is not heard of"
    assert landed(mission)


def test_a_link_that_stays_away_ends_the_mission_with_that_cause():
    mission = make("link:silent@10")
    end = mission.run()
    assert end.outcome is Outcome.GIVEN_UP
    assert "keep_link (link is UNKNOWN, after link UP -> UNKNOWN (extern): not heard of for 2 s)" in end.reason


def test_an_imu_that_fails_degrades_the_map_and_is_said():
    mission = make("imu@8")
    end = mission.run()
    assert (end.outcome, end.reason) == (Outcome.DEGRADED, "the IMU failed, mapped by LiDAR and autopilot alone")
    assert [skill for skill, _, _ in executions(mission)].count("goto_straight") == len(ROUTE)
    assert landed(mission)


def test_both_sensors_dead_is_given_up_and_landed():
    mission = make("zed@8", "lidar@8")
    end = mission.run()
    assert end.outcome is Outcome.GIVEN_UP
    assert "zed_ok" in end.reason
    assert [skill for skill, _, _ in executions(mission)][-3:] == ["lidar_depthmap", "hover", "land"]
    assert landed(mission)


def test_a_lidar_that_is_broken_from_the_start_keeps_the_mission_on_the_ground():
    mission = make("lidar")
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
    first, second = make("zed@40", seed=5), make("zed@40", seed=5)
    first.run()
    second.run()
    assert first.events == second.events


def test_a_campaign_always_comes_to_an_end_and_down():
    """Seeds, failures of sensors at random times, and functions that fail by chance on top."""
    troubles = Mission.load("mapping", behaviour=[Path(__file__).with_name("uav_missions_troubles.yaml")])
    outcomes: Counter[Outcome] = Counter()
    for seed in range(100):
        chance = random.Random(seed)  # noqa: S311 - no secret
        faults = [
            parts.FaultRequest(name, begin_s=chance.uniform(0.0, 110.0)) for name in chance.sample(["zed", "lidar"], chance.randint(0, 2))
        ]
        mission = troubles.mocked(*faults, seed=seed, tick_period_s=1.0)
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


def test_a_flight_without_eyes_leaves_its_record(tmp_path):
    flown = MISSION.run("zed@8", "lidar@8", out=tmp_path / "run")
    assert flown.notes == []
    run = open_run(tmp_path / "run")
    mission, record = run.mission, run.record
    assert (mission["outcome"], mission["waypoints_reached"]) == ("given_up", 1)
    events = [entry.value for entry in record.topic("/events")]
    for skillset in ("navigation", "perception", "mapping"):
        numbers = [event["sequence"] for event in events if event["skillset"] == skillset]
        assert numbers == list(range(1, len(numbers) + 1))
    told = [(fault.sensor, round(fault.t_s - mission["lift_off_s"], 2)) for fault in run.faults]
    assert told == [("zed", 8.0), ("lidar", 8.0)]
    assert (tmp_path / "run/tree.svg").read_text().startswith("<svg")
    assert [entry.value for entry in record.topic("/tree")][-1]["status"] == "FAILURE"
    assert [entry.value["outcome"] for entry in record.topic("/mission")] == ["running", "given_up"]
    assert [entry.value for entry in record.topic("/mission")][-1] == mission
    decisions = [entry.value for entry in record.topic("/decisions")]
    assert [decision["number"] for decision in decisions] == list(range(1, len(decisions) + 1))
    assert [f"{decision['kind']} {decision['skill']}" for decision in decisions] == WITHOUT_EYES
    assert decisions[0]["inputs"] == {"height": 3.0, "speed": 2.0}
    requested = [event["id"] for event in events if event.get("state") == "REQUESTED"]
    assert [decision["id"] for decision in decisions if decision["kind"] == "start"] == requested
    ends = {entry.value["id"]: entry.value["state"] for entry in record.topic("/reports")}
    assert ends == {event["id"]: event["state"] for event in events if event["kind"] == "EXECUTION"}
    assert {name for entry in record.topic("/blackboard") for name in entry.value} >= {"failures", "reason", "waypoint"}


def test_a_full_disk_ends_the_record_and_not_the_flight(tmp_path):
    (tmp_path / "skills.mcap").symlink_to("/dev/full")
    assert MockedMission(MISSION.skillsets, MISSION.behaviour, MISSION.plan, out=tmp_path).run().outcome is Outcome.ACCOMPLISHED
    mission = Run(tmp_path).mission
    assert mission["outcome"] == "accomplished"
    assert mission["problems"] == ["skills.mcap ends early: No space left on device"]


def test_a_folder_that_goes_away_in_flight_does_not_end_it(tmp_path):
    out = tmp_path / "run"
    mission = MISSION.mocked(out=out)
    mission.world.clock.after(20.0, lambda: shutil.rmtree(out))
    assert mission.run().outcome is Outcome.ACCOMPLISHED
    assert not out.exists()


def test_a_wrong_request_writes_nothing(tmp_path):
    with pytest.raises(
        AlulaError,
        match="there is no fault 'camera' in the behaviour; it has link:silent, zed, lidar, pilot, pilot:lands, pilot:stick, wind",
    ):
        MISSION.run("camera@8", out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_no_ros_is_needed(tmp_path):
    code = (
        "import sys; import alula; alula.Mission.load('mapping').run(out=sys.argv[1]); alula.open_run(sys.argv[1]).report();"
        "assert not {m for m in sys.modules if m.startswith(('rclpy', 'rospy', 'geometry_msgs'))}"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "run")], check=True, env=dict(os.environ), timeout=60)
