from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from uav_msgs.msg import FlightLimits

from alula.common.robots import load_robot_folder
from uav_skills import checks, decisions
from uav_skills.decisions import IN_AIR, ON_GROUND, SkillEnd


@dataclass
class State:
    landed_state: int = IN_AIR
    armed: bool = True
    reference: str = "position"
    reference_id: int = 7
    distance_to_go_m: float = 10.0
    vertical_to_go_m: float = 2.0
    drift_m: float = 0.0
    heading_error_rad: float = 1.0
    still_s: float = 0.0
    obstacle_stop: bool = False
    obstacle_m: float = math.inf
    unwatched: bool = False


@pytest.mark.parametrize(
    ("change", "result"),
    [
        ({}, None),
        ({"vertical_to_go_m": 0.29}, "AT_ALTITUDE"),
        ({"vertical_to_go_m": -0.29}, "AT_ALTITUDE"),
        ({"vertical_to_go_m": 0.31}, None),
        ({"vertical_to_go_m": 0.0, "landed_state": ON_GROUND}, None),
        ({"vertical_to_go_m": 0.0, "landed_state": 3}, None),
        ({"drift_m": 2.0}, None),
        ({"drift_m": 2.1}, "ABORTED"),
        ({"still_s": 5.0}, None),
        ({"still_s": 5.1}, "BLOCKED"),
        ({"still_s": 5.1, "drift_m": 2.1}, "ABORTED"),
        ({"vertical_to_go_m": 0.1, "still_s": 9.0, "drift_m": 9.0}, "AT_ALTITUDE"),
        ({"still_s": 9.0, "landed_state": ON_GROUND}, None),
        ({"still_s": 12.1, "landed_state": ON_GROUND}, "BLOCKED"),
        ({"still_s": 5.1, "landed_state": 3}, "BLOCKED"),
    ],
)
def test_takeoff(change, result):
    verdict = decisions.decide_takeoff(State(**change))
    assert (verdict.result if verdict else None) == result


@pytest.mark.parametrize(
    ("change", "result"),
    [
        ({}, None),
        ({"distance_to_go_m": 0.34}, "ARRIVED"),
        ({"distance_to_go_m": 0.36}, None),
        ({"drift_m": 3.0}, None),
        ({"drift_m": 3.1}, "ABORTED"),
        ({"still_s": 5.1}, "BLOCKED"),
    ],
)
def test_goto(change, result):
    verdict = decisions.decide_goto(State(**change))
    assert (verdict.result if verdict else None) == result


def test_a_blocked_flight_tells_of_the_obstacle():
    verdict = decisions.decide_goto(State(still_s=6.0, obstacle_stop=True, obstacle_m=2.4))
    assert verdict == SkillEnd("BLOCKED", "held back for 6.0 s by an obstacle 2.4 m ahead")
    verdict = decisions.decide_goto(State(still_s=6.0, obstacle_stop=True, unwatched=True))
    assert verdict == SkillEnd("BLOCKED", "held back for 6.0 s: no sensor watches the way ahead")


@pytest.mark.parametrize(
    ("change", "result"),
    [
        ({}, None),
        ({"heading_error_rad": 0.059}, "ALIGNED"),
        ({"heading_error_rad": -0.059}, "ALIGNED"),
        ({"heading_error_rad": -0.061}, None),
        ({"still_s": 5.1}, "BLOCKED"),
    ],
)
def test_rotation(change, result):
    verdict = decisions.decide_rotation(State(**change))
    assert (verdict.result if verdict else None) == result


@pytest.mark.parametrize(
    ("change", "result"),
    [
        ({}, None),
        ({"landed_state": ON_GROUND}, None),
        ({"landed_state": ON_GROUND, "armed": False}, "LANDED"),
        ({"landed_state": 4, "armed": False}, None),
        ({"still_s": 15.1}, "BLOCKED"),
        ({"still_s": 15.1, "landed_state": ON_GROUND}, None),
    ],
)
def test_landing(change, result):
    verdict = decisions.decide_landing(State(**change))
    assert (verdict.result if verdict else None) == result


def test_a_reference_that_was_dropped_is_not_ours_although_it_keeps_its_id():
    assert decisions.speaks_of(State(), kind="position", reference_id=7)
    assert not decisions.speaks_of(State(reference="idle"), kind="position", reference_id=7)
    assert not decisions.speaks_of(State(), kind="position", reference_id=8)


def test_silence_and_time():
    assert decisions.decide_watch(2.0, "ZED") is None
    assert decisions.decide_watch(2.1, "ZED") == SkillEnd("LOST", f"no obstacle message of the ZED for 2.1 s: {decisions.UNHEARD}")
    assert decisions.decide_stream(1.0, told_idle=True) is None
    assert decisions.decide_stream(1.1, told_idle=False) == SkillEnd(
        "LOST", f"nothing was heard of the video encoder for 1.1 s: {decisions.UNHEARD}"
    )
    assert decisions.decide_stream(1.1, told_idle=True) == SkillEnd("LOST", "the video encoder was started again and sends nothing")
    assert decisions.decide_mapping(3.0, "silent") is None
    assert decisions.decide_mapping(3.1, "") == SkillEnd("ABORTED", "no scan registered for 3.1 s")
    assert decisions.decide_mapping(3.1, "no cloud for 3.4 s").message == "no scan registered for 3.1 s; the LiDAR: no cloud for 3.4 s"
    assert decisions.decide_hover(1.9, 2.0) is None
    assert decisions.decide_hover(2.0, 2.0) == SkillEnd("DONE")


@given(st.floats(0.0, 1e4), st.floats(0.0, 1e4))
def test_progress_is_always_a_part_of_one(remaining, initial):
    assert 0.0 <= decisions.remaining_part(remaining, initial) <= 1.0


def test_progress_counts_what_is_behind():
    assert decisions.remaining_part(3.0, 4.0) == pytest.approx(0.25)
    assert decisions.remaining_part(0.0, 0.0) == 1.0


@pytest.mark.parametrize(
    ("height_m", "speed_m_s", "complaint"),
    [
        (3.0, 2.0, ""),
        (math.nan, 2.0, "height is nan, not a finite number"),
        (25.0, 2.0, "height is 25 m; it must be above 0 and at most 20 m"),
        (3.0, 3.5, "speed is 3.5 m/s; it must be above 0 and at most 3 m/s"),
        (3.0, 0.0, "speed is 0 m/s; it must be above 0 and at most 3 m/s"),
    ],
)
def test_takeoff_inputs(height_m, speed_m_s, complaint):
    assert checks.check_takeoff(height_m=height_m, speed_m_s=speed_m_s) == complaint


@pytest.mark.parametrize(
    ("target", "complaint"),
    [
        ((44.0, 14.0, 3.0), ""),
        ((50.0, 50.0, 3.0), "70.7 m from home; the fence is at 60 m"),
        ((0.0, 0.0, 21.0), "target height is 21 m"),
        ((0.0, math.inf, 3.0), "not a finite number"),
    ],
)
def test_targets(target, complaint):
    found = checks.check_target(target_enu_m=target, speed_m_s=1.0)
    assert complaint in found
    assert bool(found) == bool(complaint)


def test_turns_and_durations():
    assert checks.check_turn(heading_rad=9.0, rate_rad_s=0.6) == ""
    assert "heading is inf" in checks.check_turn(heading_rad=math.inf, rate_rad_s=0.6)
    assert "rate is 2 rad/s" in checks.check_turn(heading_rad=0.0, rate_rad_s=2.0)
    assert checks.check_duration(duration_s=2.0) == ""
    assert "duration is -1 s" in checks.check_duration(duration_s=-1.0)


def test_the_page_shows_the_fence_that_the_guidance_enforces():
    fence = load_robot_folder(Path(__file__).parents[4]).page["fence"]
    assert fence == {"radius_m": FlightLimits.FENCE_RADIUS_M, "z": [FlightLimits.FENCE_FLOOR_M, FlightLimits.FENCE_HEIGHT_M]}
