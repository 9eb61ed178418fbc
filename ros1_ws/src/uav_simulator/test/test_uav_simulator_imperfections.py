"""Imperfections: off changes nothing, each has its size, and the seed repeats them."""

import math

import numpy as np
import pytest

from uav_simulator.autopilot.estimator import Estimator
from uav_simulator.errors import ConfigError
from uav_simulator.imperfections import PRESETS, Imperfections, parse_imperfections
from uav_simulator.sensors.imu import Imu
from uav_simulator.sensors.lidar import Lidar
from uav_simulator.sensors.pose_track import Pose, PoseTrack
from uav_simulator.sensors.stereo import StereoPair
from uav_simulator.vehicle.airframe import Airframe
from uav_simulator.vehicle.quaternion import from_yaw
from uav_simulator.vehicle.rigid_body import RigidBody
from uav_simulator.world.config import find_world, load_world
from uav_simulator.world.parts import build_parts
from uav_simulator.world.scene import Scene

TICK_S = 0.02


def flown(imperfections, *, way_m=40.0, speed_m_s=1.0, seed=3):
    """Return a body's estimate after a straight way at 3 m, and the errors of its position on the way, (N, 3)."""
    body = RigidBody(Airframe(), (0.0, 0.0, 3.0))
    body.on_ground = False
    body.velocity = (speed_m_s, 0.0, 0.0)
    estimator = Estimator(seed, imperfections)
    errors = []
    for n in range(round(way_m / speed_m_s / TICK_S)):
        body.position = (speed_m_s * TICK_S * (n + 1), 0.0, 3.0)
        estimate = estimator.step(body, TICK_S)
        errors.append(np.subtract(estimate.position, body.position))
    return estimate, np.array(errors)


@pytest.mark.parametrize("drift", [0.02, 0.05])
def test_the_position_drifts_with_the_way(drift):
    _, errors = flown(Imperfections(position_drift=drift))
    length = np.linalg.norm(errors, axis=1)
    assert 0.8 * drift * 40.0 <= length[-1] <= drift * 40.0 + 0.05
    assert length[len(length) // 2] == pytest.approx(length[-1] / 2, rel=0.25)
    assert np.abs(np.diff(errors, axis=0)).max() < 0.01, "it never jumps"
    assert np.array_equal(flown(Imperfections(position_drift=drift))[1], errors)
    assert not np.allclose(flown(Imperfections(position_drift=drift), seed=4)[1][-1], errors[-1], atol=0.05)


def test_the_heading_drifts_with_the_way():
    estimate, _ = flown(Imperfections(yaw_drift_deg=5.0))
    assert abs(math.degrees(estimate.yaw_error_rad)) == pytest.approx(2.0, abs=1.0)


def test_the_position_jumps_as_often_and_as_far_as_asked():
    _, errors = flown(Imperfections(position_jump_m=0.5, jump_every_s=10.0))
    steps = np.linalg.norm(np.diff(errors, axis=0), axis=1)
    assert np.count_nonzero(steps > 0.4) == 3
    assert steps.max() == pytest.approx(0.5, abs=0.01)


def test_the_heading_wanders_there_and_back():
    off_deg = [math.degrees(flown(Imperfections(yaw_walk_deg=20.0), way_m=way_m)[0].yaw_error_rad) for way_m in (5.0, 50.0, 95.0)]
    assert abs(off_deg[0]) < 1.5
    assert abs(off_deg[1]) == pytest.approx(20.0, abs=1.0)
    assert abs(off_deg[2]) < 1.5


def test_roll_and_pitch_are_off_by_a_constant_and_a_slow_walk():
    estimates = [flown(Imperfections(tilt_bias_deg=2.0), seed=seed, way_m=1.0)[0] for seed in range(12)]
    off_deg = np.degrees([estimate.euler[:2] for estimate in estimates])
    assert np.abs(off_deg) == pytest.approx(2.0, abs=0.01)
    assert {tuple(signs) for signs in np.sign(off_deg)} == {(-1, -1), (-1, 1), (1, -1), (1, 1)}
    walked = np.degrees([flown(Imperfections(tilt_walk_deg=1.0), seed=seed, way_m=60.0)[0].euler[:2] for seed in range(12)])
    assert walked.std() == pytest.approx(1.0, rel=0.4)
    assert np.degrees(flown(PRESETS["off"])[0].euler[:2]) == pytest.approx(0.0, abs=1e-9)


def test_the_height_is_noisy_and_drifts():
    _, drifting = flown(Imperfections(height_drift_m=0.2), way_m=300.0)
    assert drifting[:, 2].std() == pytest.approx(0.2, rel=0.6)
    assert np.abs(np.diff(drifting[:, 2])).max() < 0.03
    _, noisy = flown(Imperfections(height_noise_m=0.2), way_m=60.0)
    assert noisy[:, 2].std() == pytest.approx(0.2, rel=0.2)
    assert np.abs(noisy[:, 2].reshape(-1, 500).mean(axis=1)).max() < 0.2, "over 10 s it is nothing"


def test_the_height_runs_away_in_the_air_up_or_down_and_the_climb_says_so():
    estimates = [flown(Imperfections(height_drift_m_s=0.02), seed=seed) for seed in range(8)]
    off_m = np.array([errors[-1, 2] for _, errors in estimates])
    assert np.abs(off_m) == pytest.approx(0.8, abs=0.03)
    assert set(np.sign(off_m)) == {-1.0, 1.0}
    still, broken = Estimator(3, Imperfections(height_drift_m_s=0.02)), Estimator(3)
    body = RigidBody(Airframe(), (0.0, 0.0, 0.0))
    on_ground = [still.step(body, TICK_S).position[2] for _ in range(2000)]
    assert np.abs(on_ground).max() < 0.02, "not on the ground"
    body.on_ground, broken.barometer.broken = False, True
    in_air = [broken.step(body, TICK_S).position[2] for _ in range(2000)]
    assert abs(in_air[-1]) == pytest.approx(0.6, abs=0.03), "40 s at 0.015 m/s"


def test_standing_still_is_no_way():
    _, errors = flown(Imperfections(position_drift=0.05), speed_m_s=0.1, way_m=4.0)
    assert np.linalg.norm(errors[-1]) < 0.03


def test_without_imperfections_the_estimate_is_the_one_of_before():
    assert np.linalg.norm(flown(PRESETS["off"])[1], axis=1).max() < 0.03


@pytest.fixture(scope="module")
def world():
    return Scene(build_parts(load_world(find_world("yard")), 0))


def test_images_and_ranges_are_noisier_and_the_light_wanders(world):
    pose = Pose(0.0, (10.0, 0.0, 3.0), from_yaw(0.0))
    good, noisy = (StereoPair(world, 0, noise=noise).render(pose)[0].astype(float) for noise in (0.0, 8.0))
    assert (noisy - good).std() == pytest.approx(math.hypot(2.0, 8.0) - 2.0, abs=1.5)
    pair = StereoPair(world, 0, exposure=0.3)
    means = [pair.render(pose)[0].mean() for _ in range(15)]
    assert 0.05 < np.ptp(means) / np.mean(means) < 0.6
    track = PoseTrack()
    for n in range(8):
        track.add(Pose(0.02 * n, pose.position, pose.attitude))
    exact, rough = (Lidar(world, 0, noise_m=noise).scan(track, 0.02) for noise in (0.0, 0.1))
    spread = np.linalg.norm([rough[axis] - exact[axis] for axis in "xyz"], axis=0)
    assert 0.07 < math.sqrt(np.mean(spread**2)) < 0.1, "0.102 against 0.02 on the same draws"


def test_the_imu_has_a_bias_of_its_size():
    def bias(seed, **sizes):
        imu = Imu(seed, **sizes)
        return np.mean([imu.measure((0.0, 0.0, 0.0), (0.0, 0.0, 9.81)).rates for _ in range(200)], axis=0)

    biases = np.array([bias(seed, gyro_bias_rad_s=0.02) for seed in range(20)])
    assert biases.std() == pytest.approx(0.02, rel=0.35)
    assert np.array([bias(seed) for seed in range(20)]).std() < 0.002


def test_imperfections_are_read_and_refused():
    assert parse_imperfections("") == parse_imperfections("off") == Imperfections()
    assert parse_imperfections("realistic") == PRESETS["realistic"]
    mixed = parse_imperfections("realistic, position_drift=0.05")
    assert (mixed.position_drift, mixed.exposure) == (0.05, PRESETS["realistic"].exposure)
    for wrong, said in (
        ("real", "there are off, realistic, position_drift=VALUE.*did you mean `realistic`"),
        ("position_drift", "unknown"),
        ("position_drift=much", "'much' is no number"),
        ("exposure=-1", "no number from 0 on"),
        ("exposure=nan", "no number from 0 on"),
    ):
        with pytest.raises(ConfigError, match=said):
            parse_imperfections(wrong)
