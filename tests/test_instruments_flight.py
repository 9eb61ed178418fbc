"""Flights that the air or their instruments make hard: the GPS is lost, the barometer drifts, the IMU dies, a strong wind blows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from ruamel.yaml import YAML

from alula_testing.flights import ALULA_ROOT, start_flight

pytestmark = [pytest.mark.flight, pytest.mark.timeout(1200)]
YARD = ALULA_ROOT / "tests/recordings/short_yard.yaml"
WHOLE_YARD = ALULA_ROOT / "ros1_ws/src/uav_simulator/worlds/yard.yaml"
FAILED_S = 6.0  # from lift-off; on the first leg
FAILSAFE_S = 7.8  # from then on, of the simulated autopilot, as of ArduCopter's
MIN_CLEARANCE_M = 0.8
MAX_RMSE_M = 0.15
DRIFTS_S, DRIFT_M_S = 10.0, 0.015  # from lift-off; on the first leg
HEIGHT_M, MAX_OFF_M = 3.0, 0.15
MAX_RMS_M = 0.08
MAX_UNTOLD_M = 0.3


def flown(folder: Path, *options: str, code: int, world: Path = YARD, seed: int = 3) -> dict[str, Any]:
    """Fly the first leg of the yard, or another world; return the summary."""
    flight = start_flight(folder / "run", "--rate", "0", "--seed", str(seed), "--world", str(world), *options)
    try:
        flight.end(code)
    finally:
        flight.give_up()
    summary = flight.summary
    assert summary["landed"] is True
    assert summary["collisions"] == 0
    assert summary["min_clearance_m"] >= MIN_CLEARANCE_M
    assert summary["problems"] == []
    return summary


def test_a_lost_gps_is_landed_by_the_mission_before_the_autopilot_gives_up(tmp_path: Path) -> None:
    summary = flown(tmp_path, "--fail", f"gps@{FAILED_S:g}", code=1)
    assert summary["outcome"] == "given_up"
    assert summary["reason"].startswith("navigation.goto_straight: RESOURCE_INVARIANT_VIOLATED keep_position")
    assert summary["reason"].endswith("nothing is heard of the GPS)")
    landing = summary["skills"][-1]
    assert (landing["skill"], landing["outcome"], landing["result"]) == ("land", "TERMINATED", "LANDED")
    assert landing["start_s"] - FAILED_S < 1.5
    assert not [one for one in summary["resources"] if one["to"] == "UNAVAILABLE"], "no failsafe has taken it"
    (answer,) = summary["answers"]
    assert (answer["sensor"], answer["detected_by"]) == ("gps", "navigation.position_status KNOWN -> LOST")
    down_s = next(one["t_s"] for one in summary["resources"] if one["to"] == "ON_GROUND")
    assert down_s - FAILED_S < FAILSAFE_S + 1.0, "the failsafe alone would begin to land then"


def two_legs(folder: Path) -> Path:
    """Write the yard with the first two of its four legs; return the file."""
    yaml, path = YAML(), folder / "two_legs.yaml"
    world = yaml.load(WHOLE_YARD.read_text(encoding="utf-8"))
    del world["route"][3:]
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(world, file)
    return path


def true_heights_m(folder: Path, start_s: float, end_s: float) -> np.ndarray:
    """Return the vehicle's true heights over the place of its take-off between two times from lift-off."""
    with AnyReader([folder / "run/functional.bag"]) as bag:
        truth = [one for one in bag.connections if one.topic == "/sim/true_pose"]
        poses = [bag.deserialize(data, connection.msgtype) for connection, _, data in bag.messages(truth)]
    stamps_s = np.array([one.header.stamp.sec + one.header.stamp.nanosec / 1e9 for one in poses])
    heights_m = np.array([one.pose.position.z for one in poses]) - poses[0].pose.position.z
    since_s = stamps_s - stamps_s[np.argmax(heights_m > 0.05)]
    return np.asarray(heights_m[(since_s >= start_s) & (since_s <= end_s)])


@pytest.mark.parametrize("seed", [pytest.param(0, id="down"), pytest.param(2, id="up")])
def test_a_barometer_that_drifts_is_found_and_takes_neither_vehicle_nor_map_along(seed: int, tmp_path: Path) -> None:
    summary = flown(tmp_path, "--fail", f"barometer@{DRIFTS_S:g}", code=0, world=two_legs(tmp_path), seed=seed)
    assert (summary["outcome"], summary["reason"]) == ("degraded", "the barometer drifted, flown by the map's height")
    told = next(one for one in summary["resources"] if one["resource"] == "height_status")
    assert (told["to"], "lower" in told["reason"]) == ("DRIFTING", seed == 0)
    assert DRIFT_M_S * (told["t_s"] - DRIFTS_S) <= MAX_UNTOLD_M
    legs = [one for one in summary["skills"] if one["skill"] == "goto_straight"]
    off_m = true_heights_m(tmp_path, legs[0]["start_s"], legs[-1]["end_s"]) - HEIGHT_M
    assert np.abs(off_m).max() <= MAX_OFF_M
    assert np.sqrt(np.mean(off_m**2)) <= MAX_RMS_M
    assert summary["map"]["rmse_m"] <= MAX_RMS_M


def test_a_dead_imu_is_told_and_the_map_goes_on_without_it(tmp_path: Path) -> None:
    summary = flown(tmp_path, "--fail", f"imu@{FAILED_S:g}", code=0)
    assert (summary["outcome"], summary["reason"]) == ("degraded", "the IMU failed, mapped by LiDAR and autopilot alone")
    (told,) = [one for one in summary["resources"] if one["resource"] == "imu_status"]
    assert (told["to"], told["reason"]) == ("BROKEN", "no reading has come for a second")
    assert told["t_s"] - FAILED_S == pytest.approx(1.0, abs=0.6)
    assert summary["map"]["rmse_m"] <= MAX_RMSE_M


def test_a_wind_of_8_m_s_with_gusts_is_flown_to_the_end(tmp_path: Path) -> None:
    """Whole, but perhaps not as planned: of three such flights one was held back in its first leg for 5 s, and flew that leg again."""
    summary = flown(tmp_path, "--imperfections", "wind_m_s=8,gust_m_s=1.5", code=0)
    assert (summary["landed"], summary["collisions"]) == (True, 0)
    assert [one["result"] for one in summary["skills"] if one["skill"] in {"goto_straight", "goto"}][-1] == "ARRIVED"
    assert summary["map"]["rmse_m"] <= MAX_RMSE_M
