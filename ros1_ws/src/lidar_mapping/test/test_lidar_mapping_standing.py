"""The gyro's bias is learned while the vehicle stands, and only then; the SLAM begins with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lidar_mapping_yard import Path
from scipy.spatial.transform import Rotation

from lidar_mapping import Slam, SlamSettings
from lidar_mapping.inertial import GYRO_BIAS
from lidar_mapping.standing import StandingGyro
from perception_core import NS, PoseBuffer

BIAS = np.array([0.05, -0.05, 0.05])
STANDING = Path(lambda _t: np.zeros(3))


def hear(gyro, path, start_s, end_s, *, bias=BIAS, poses=True, gaps=()) -> None:
    """Let a gyro hear the readings of a path, and the autopilot's poses at 50 Hz."""
    rng, said = np.random.default_rng(3), PoseBuffer(keep_s=3.0)
    for reading in path.readings(start_s, end_s, rng):
        t_s = reading.stamp_ns / NS
        pose = path.pose(t_s)
        if poses and reading.stamp_ns % 20_000_000 == 0:
            said.add(reading.stamp_ns, tuple(pose[:3, 3]), Rotation.from_matrix(pose[:3, :3]).as_quat())
        if not any(first <= t_s < last for first, last in gaps):
            gyro.add(replace(reading, rates=reading.rates + bias), said)


def test_a_vehicle_that_stands_tells_the_bias() -> None:
    gyro = StandingGyro()
    hear(gyro, STANDING, 0.0, 1.9)
    assert not gyro.bias.any(), "too short to tell"
    gyro = StandingGyro()
    hear(gyro, STANDING, 0.0, 5.0)
    assert gyro.bias == pytest.approx(BIAS, abs=0.0008)


@pytest.mark.parametrize(
    ("what", "path"),
    [
        ("flies", Path(lambda t: np.array([1.0 * t, 0.0, 2.0]))),
        ("turns", Path(lambda _t: np.zeros(3), yaw=lambda t: 0.05 * t)),
        ("is held in hands", Path(lambda _t: np.zeros(3), yaw=lambda t: 0.005 * np.sin(2 * np.pi * 0.7 * t))),
    ],
)
def test_a_vehicle_that_moves_tells_nothing(what, path) -> None:
    gyro = StandingGyro()
    hear(gyro, path, 0.0, 9.0)
    assert not gyro.bias.any(), what


def test_without_the_autopilots_pose_nothing_is_told() -> None:
    gyro = StandingGyro()
    hear(gyro, STANDING, 0.0, 9.0, poses=False)
    assert not gyro.bias.any()


def test_what_was_told_while_it_stood_is_kept_in_flight_and_told_anew_by_the_next_stand() -> None:
    gyro = StandingGyro()
    hear(gyro, STANDING, 0.0, 4.5)
    told = gyro.bias
    hear(gyro, Path(lambda t: np.array([1.0 * t, 0.0, 2.0])), 5.0, 12.0, bias=-BIAS)
    assert gyro.bias is told
    hear(gyro, STANDING, 13.0, 17.5, bias=-BIAS)
    assert gyro.bias == pytest.approx(-BIAS, abs=0.0008)


def test_a_stand_says_how_well_it_tells_the_bias_and_that_this_is_over_with_time() -> None:
    gyro = StandingGyro()
    hear(gyro, STANDING, 0.0, 1.5)
    assert gyro.sigma_rad_s(NS) == np.inf
    hear(gyro, STANDING, 1.5, 4.5)
    assert gyro.sigma_rad_s(5 * NS) == pytest.approx(0.0005, abs=5e-5)
    assert gyro.sigma_rad_s(105 * NS) - gyro.sigma_rad_s(5 * NS) == pytest.approx(0.001)


def test_a_vehicle_that_turns_so_slowly_that_it_seems_to_stand_tells_the_bias_within_that() -> None:
    gyro = StandingGyro()
    hear(gyro, Path(lambda _t: np.zeros(3), lambda t: 0.008 * t), 0.0, 4.5)
    off = float(np.abs(gyro.bias - BIAS).max())
    assert 0.007 < off < gyro.sigma_rad_s(4 * NS) + 0.0005


@pytest.mark.parametrize(("said", "begins"), [(np.inf, 0.003), (0.0005, 0.0005), (0.02, 0.003)])
def test_a_slam_begins_with_the_bias_as_well_as_it_is_known_but_no_worse_than_any(said, begins) -> None:
    path, slam = Path(from_rest, across_deg=17.0), Slam(SlamSettings())
    slam.gyro_bias_rad_s = said
    slam.add(path.sweep(0.0, seed=1), path.readings(0.0, 0.1, np.random.default_rng(7)), path.autopilot(0.1), np.eye(4))
    known = slam._odometry.filter.covariance[GYRO_BIAS, GYRO_BIAS]
    assert np.sqrt(np.diag(known)) == pytest.approx(np.full(3, begins), rel=0.05)


def test_a_gap_in_the_readings_begins_a_window_anew() -> None:
    gyro = StandingGyro()
    hear(gyro, STANDING, 0.0, 9.0, gaps=[(k + 0.5, k + 1.0) for k in range(9)])
    assert not gyro.bias.any()


def from_rest(t):
    way = 0.6 * (t - 2.0 * (1.0 - np.exp(-t / 2.0))) if t > 0.0 else 0.0
    return np.array([way - 8.0, 0.5 * np.sin(way / 3.0), 2.0])


def test_a_slam_that_knows_the_bias_keeps_its_heading_from_the_first_sweep_on() -> None:
    path, slam, rng = Path(from_rest, across_deg=17.0), Slam(SlamSettings()), np.random.default_rng(7)
    slam.gyro_bias = BIAS
    for k in range(80):
        readings = [replace(each, rates=each.rates + BIAS) for each in path.readings(k / 10, k / 10 + 0.1, rng)]
        slam.add(path.sweep(k / 10, seed=k, count=2500), readings, path.autopilot(k / 10 + 0.1), np.eye(4))
        turned = Rotation.from_matrix(path.pose(k / 10 + 0.1)[:3, :3].T @ slam.pose()[0][:3, :3]).magnitude()
        assert np.degrees(turned) < 0.3, f"3.9 without; at {k / 10} s"
