"""State, surface, registration and odometry; on real scans with their true motion where the data is there."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from lidar_mapping_yard import yard
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from lidar_mapping import (
    AutopilotMotion,
    ImuReading,
    InertialFilter,
    InertialNoise,
    InertialState,
    Keyframes,
    LidarInertialOdometry,
    OdometrySettings,
    Patches,
    RegistrationSettings,
    Surface,
    downsample,
    flat_patches,
    register,
)
from lidar_mapping.registration import SEARCHED_M
from lidar_mapping.surface import PATCH_M, join, smallest_axis
from perception_core import NS, Sweep

ROOT = Path(__file__).resolve().parents[4]
DATA = Path(os.environ.get("ALULA_DATA", ROOT.parent / "shared" / "data"))
small = st.floats(-0.3, 0.3)
vectors = st.tuples(small, small, small).map(np.array)
IDENTITY = InertialState(np.eye(3), np.zeros(3), np.zeros(3))


def filter_at(position=(0.0, 0.0, 2.0), *, sigma_m=0.1, sigma_rad=0.02) -> InertialFilter:
    found = InertialFilter(InertialNoise(start_attitude_rad=sigma_rad), 0, InertialState(np.eye(3), np.zeros(3), np.array(position)))
    found.covariance[6:9, 6:9] = np.eye(3) * sigma_m**2
    return found


@given(vectors, vectors, vectors, vectors, vectors, vectors, vectors)
@settings(max_examples=40)
def test_an_error_leads_from_one_state_to_the_other(turn, velocity, position, gyro, accel, autopilot, drift) -> None:
    error = np.concatenate([turn, velocity, position, gyro, accel, autopilot, drift])
    start = InertialState(Rotation.from_rotvec(turn[::-1]).as_matrix(), position, velocity, accel, gyro, gyro[::-1], drift[::-1])
    assert start.plus(error).minus(start) == pytest.approx(error, abs=1e-9)


def test_propagation_follows_a_known_motion_and_grows_uncertain() -> None:
    rate, speed = 0.5, 2.0  # rad/s about z, m/s: a circle of 4 m
    found = InertialFilter(InertialNoise(), 0, InertialState(np.eye(3), np.array([speed, 0.0, 0.0]), np.zeros(3)))
    before = found.covariance.copy()
    for k in range(1, 1001):
        found.propagate(ImuReading(k * 2_000_000, np.array([0.0, 0.0, rate]), np.array([0.0, speed * rate, 9.81])))
    radius = speed / rate
    assert found.state.position == pytest.approx([radius * np.sin(1.0), radius * (1 - np.cos(1.0)), 0.0], abs=0.01)
    assert Rotation.from_matrix(found.state.rotation).as_rotvec() == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    assert np.all(np.diag(found.covariance)[:9] > np.diag(before)[:9])


def test_a_turn_is_followed_while_it_goes_on() -> None:
    found = InertialFilter(InertialNoise(), 0, IDENTITY)
    for k in range(101):  # 50 Hz, a turn of 1 rad within 2 s
        t = k / 50
        found.propagate(ImuReading(k * 20_000_000 + 1, np.array([0.0, 0.0, 0.5 * (1 - np.cos(np.pi * t))]), np.array([0.0, 0.0, 9.81])))
        heading = 0.5 * (t - np.sin(np.pi * t) / np.pi)
        assert Rotation.from_matrix(found.state.rotation).as_rotvec()[2] == pytest.approx(heading, abs=1e-3)


def scanned(*, warmed_rad_s2=0.0, bent_rad=0.0) -> tuple[InertialFilter, float]:
    """The filter after 45 s and the gyro's true bias then: scans of ten a second hold it, in the last 5 s they come from bare walls.

    There each says that the vehicle is turned farther by ``bent_rad`` than the filter has it. The bias grows from zero.
    """
    found, bias = InertialFilter(InertialNoise(), 0, IDENTITY), 0.0
    for k in range(1, 2251):
        bias = warmed_rad_s2 * k / 50
        found.propagate(ImuReading(k * 20_000_000, np.array([0.0, 0.0, bias]), np.array([0.0, 0.0, 9.81])))
        if k % 5 == 0:
            bare = k > 2000
            said = (heading_of(found) + bent_rad) * np.array([0.0, 0.0, 1.0]) if bare and bent_rad else np.zeros(3)
            information = np.diag(np.r_[np.full(3, 8e4 if bare else 5e5), np.full(6, 1e4), np.zeros(12)])
            target = replace(IDENTITY, rotation=Rotation.from_rotvec(said).as_matrix())
            found.correct(lambda state, matrix=information, there=target: (matrix, matrix @ state.minus(there)))
    return found, bias


def heading_of(found: InertialFilter) -> float:
    return float(Rotation.from_matrix(found.state.rotation).as_rotvec()[2])


def test_a_turn_that_scans_hand_on_along_bare_walls_is_not_taken_for_the_gyros_bias() -> None:
    found, _ = scanned(bent_rad=0.007)  # as in the yard of seed 2, third leg
    assert abs(found.state.gyro_bias[2]) < 0.0005
    assert heading_of(found) < 0.016


def test_a_gyro_that_warms_up_is_followed() -> None:
    found, bias = scanned(warmed_rad_s2=1e-5)  # 10 K within 260 s, 0.26 mrad/s a kelvin: the Bosch BMI088
    assert found.state.gyro_bias[2] == pytest.approx(bias, abs=0.0003)
    assert heading_of(found) == pytest.approx(0.0, abs=0.001)


def test_a_plane_is_flat_and_an_edge_is_not() -> None:
    rng = np.random.default_rng(1)
    floor = np.stack([*rng.uniform(0.0, 4.0, (2, 4000)), rng.normal(0.0, 0.01, 4000)], axis=1)
    wall = np.stack([rng.normal(0.0, 0.01, 4000), rng.uniform(0.0, 4.0, 4000), rng.uniform(0.0, 4.0, 4000)], axis=1)
    both = downsample(np.vstack([floor, wall]), 0.08)
    patches = flat_patches(both, both)
    assert len(patches.points) > 0.7 * len(both)
    to_floor, to_wall = np.abs(patches.normals[:, 2]), np.abs(patches.normals[:, 0])
    assert np.mean(np.maximum(to_floor, to_wall) > 0.95) > 0.97  # the rest lies along the edge
    thread = np.stack([np.linspace(0.0, 3.0, 300), np.zeros(300), np.ones(300)], axis=1)
    assert len(flat_patches(thread, thread).points) == 0


@given(arrays(np.float64, (6, 3, 3), elements=st.floats(-1.0, 1.0)))
@settings(max_examples=60)
def test_the_smallest_axis_is_the_general_ways(factors) -> None:
    matrices = factors.transpose(0, 2, 1) @ factors
    spread, axes = smallest_axis(matrices)
    values, vectors = np.linalg.eigh(matrices)
    assert spread == pytest.approx(values[:, :2], abs=1e-6)
    apart = values[:, 1] - values[:, 0] > 1e-3 * values[:, 2] + 1e-9
    assert np.abs(np.sum(axes * vectors[:, :, 0], axis=1))[apart] == pytest.approx(1.0, abs=1e-4)


def test_points_too_near_to_one_another_tell_no_normal_and_thinned_ones_do() -> None:
    rng = np.random.default_rng(1)
    wall = np.stack([rng.normal(0.0, 0.02, 60_000), rng.uniform(0.0, 3.0, 60_000), rng.uniform(0.0, 3.0, 60_000)], axis=1)
    dense, thinned = downsample(wall, 0.03), downsample(wall, PATCH_M)
    assert len(flat_patches(thinned, dense).points) < 0.2 * len(thinned)
    patches = flat_patches(thinned, thinned)
    assert len(patches.points) > 0.9 * len(thinned)
    assert np.sqrt(np.mean(patches.points[:, 0] ** 2)) < 0.01
    frames = Keyframes(voxel_m=0.08, limit=10)
    for k in range(4):  # what the last keyframes saw lies upon one another
        frames.add(k, np.eye(4), wall[k::4])
    assert len(frames.all[-1].seen.patches.points) > 0.9 * len(thinned)


def surface_of(points) -> Surface:
    thinned = downsample(points, 0.08)
    return Surface(flat_patches(thinned, thinned))


@given(st.tuples(*[st.floats(-0.2, 0.2)] * 3), st.tuples(*[st.floats(-0.03, 0.03)] * 3))
@settings(max_examples=10)
def test_a_wrong_prediction_is_corrected(shift, turn) -> None:
    here = np.array([1.0, 0.5, 2.0])
    found = filter_at(here + shift)
    found.state = replace(found.state, rotation=Rotation.from_rotvec(turn).as_matrix())
    scan = downsample(yard(20000, 2), 0.3) - here
    result = register(scan, YARD, found, RegistrationSettings())
    assert result.believed, result.refusal
    assert found.state.position == pytest.approx(here, abs=0.02)
    assert Rotation.from_matrix(found.state.rotation).magnitude() < 0.005
    assert result.correction_m == pytest.approx(np.linalg.norm(shift), abs=0.03)


YARD = surface_of(yard(120_000, 1))


def test_to_keep_the_partners_of_points_that_hardly_move_costs_no_accuracy(monkeypatch) -> None:
    here, scan = np.array([1.0, 0.5, 2.0]), downsample(yard(20000, 2), 0.3) - [1.0, 0.5, 2.0]
    places, asked = [], []
    nearest = Surface.nearest
    monkeypatch.setattr(Surface, "nearest", lambda self, *args, **kwargs: asked.append(1) or nearest(self, *args, **kwargs))
    for moved_m in (SEARCHED_M, 0.0):
        monkeypatch.setattr("lidar_mapping.registration.SEARCHED_M", moved_m)
        found = filter_at(here + np.array([0.05, -0.03, 0.02]))
        assert register(scan, YARD, found, RegistrationSettings()).believed
        places.append((found.state.position, len(asked)))
        asked.clear()
    (kept, few), (searched, many) = places
    assert kept == pytest.approx(searched, abs=2e-3)
    assert (few <= 2, many >= RegistrationSettings().gates) == (True, True)


def test_a_surface_that_was_added_to_finds_what_one_of_all_patches_finds() -> None:
    rng = np.random.default_rng(5)
    parts = [Patches(rng.uniform(-3.0, 3.0, (count, 3)), rng.normal(size=(count, 3))) for count in (400, 0, 150, 60)]
    whole, grown = Surface(join(parts)), Surface(parts[0])
    for part in parts[1:]:
        grown = grown.joined(part)
    asked = rng.uniform(-4.0, 4.0, (500, 3))
    for one, other in zip(whole.nearest(asked, within_m=0.5), grown.nearest(asked, within_m=0.5), strict=True):
        assert np.array_equal(one, other)
    assert np.array_equal(whole.points, grown.points)
    assert np.array_equal(whole.normals, grown.normals)


def test_along_bare_walls_the_prediction_is_left_and_the_direction_is_named() -> None:
    corridor = surface_of(yard(120_000, 1, corridor=True))
    found = filter_at((0.1, 0.1, 2.0), sigma_m=0.3)
    scan = yard(20000, 2, corridor=True)
    scan = downsample(scan[np.abs(scan[:, 0]) < 12], 0.3) - [0.0, 0.0, 2.0]
    result = register(scan, corridor, found, RegistrationSettings())
    assert result.believed, result.refusal
    assert (result.degenerate, abs(result.directions[0, 0]) > 0.99) == (1, True)
    assert found.state.position[0] == pytest.approx(0.1, abs=0.03)
    assert found.state.position[1:] == pytest.approx([0.0, 2.0], abs=0.02)
    assert np.sqrt(found.covariance[6, 6]) > 0.1 > 10 * np.sqrt(found.covariance[7, 7])


def test_what_can_not_be_believed_says_why_and_leaves_the_filter_alone() -> None:
    scan = downsample(yard(20000, 2), 0.3) - [0.0, 0.0, 2.0]
    found = filter_at()
    kept = (found.state, found.covariance.copy())
    assert "too few" in register(scan[:50], YARD, found, RegistrationSettings()).refusal
    assert "points found a surface" in register(scan + np.array([0.0, 0.0, 80.0]), YARD, found, RegistrationSettings()).refusal
    elsewhere = np.random.default_rng(3).uniform(-6.0, 6.0, (3000, 3))
    assert "fitness" in register(elsewhere, YARD, found, RegistrationSettings(min_points=10)).refusal
    assert found.state is kept[0]
    assert found.covariance == pytest.approx(kept[1])


@pytest.mark.parametrize(
    ("step_m", "most_points", "made"),
    [(1.0, 30_000, range(3, 10)), (1.0, 10_000, [3, 6, 9]), (0.17, 30_000, [3, 7])],
    ids=["fast", "fast with dense sweeps", "slow"],
)
def test_a_keyframe_is_made_where_the_vehicle_has_moved_on(step_m, most_points, made) -> None:
    found, kept = odometry(replace(FREE, reach_m=30.0, most_points=most_points)), []
    for k in range(10):
        scan = yard(20_000, k) - [step_m * k, 0.0, 2.0]
        step = found.add(still(k, scan), [], np.eye(4), AutopilotMotion(np.eye(3), np.array([10.0 * step_m * (k > 0), 0.0, 0.0])))
        kept += [k] if step.keyframe and k >= 3 else []  # before, the motion is being learnt
    assert kept == list(made)


def test_keyframes_that_lie_behind_are_thinned_and_no_place_is_lost(monkeypatch) -> None:
    monkeypatch.setattr("lidar_mapping.keyframes.MOST_KEPT", 12_000)
    rng = np.random.default_rng(4)
    bounded, places = Keyframes(voxel_m=0.08, limit=100), []
    for k in range(30):  # along a wall, of which each keyframe sees 8 m
        wall = np.stack([rng.uniform(0.3 * k, 0.3 * k + 8.0, 12_000), np.full(12_000, 3.0), rng.uniform(0.0, 2.0, 12_000)], axis=1)
        pose = np.eye(4)
        pose[0, 3] = 0.3 * k
        places.append(wall)
        bounded.add(k, pose, wall)
    counts = [frame.seen.count for frame in bounded.all]
    assert sum(counts) < 0.4 * len(counts) * counts[-1]
    assert counts[-3:] == pytest.approx([counts[-1]] * 3, rel=0.1)
    kept = np.vstack([frame.points_in_map() for frame in bounded.all])
    seen = downsample(np.vstack(places), 0.25)
    away, _ = cKDTree(kept).query(seen)
    assert away.max() < 0.25


# --- real scans ------------------------------------------------------------------------------------------------------

# What is said of the motion is hardly believed: it is wrong on purpose.
FREE = OdometrySettings(noise=InertialNoise(start_velocity_m_s=10.0), autopilot_m_s=2.0)


PRIORS = {
    "none": lambda _k: None,
    "standing": lambda _k: AutopilotMotion(np.eye(3), np.zeros(3)),
    "sideways": lambda _k: AutopilotMotion(np.eye(3), np.array([0.0, 8.0, 0.0])),
    "turning": lambda k: AutopilotMotion(Rotation.from_euler("z", 20.0 * k, degrees=True).as_matrix(), np.zeros(3)),
}
"""What is said of a car that goes straight on at 8 m/s, by the sweep."""


def odometry(settings=FREE) -> LidarInertialOdometry:
    return LidarInertialOdometry(settings, Keyframes(voxel_m=settings.map_voxel_m, limit=10), 0, IDENTITY)


def still(k, points, times=None) -> Sweep:
    return Sweep(k * NS // 10, points.astype(np.float32), np.zeros(len(points), np.float32) if times is None else times)


def off(found, truth) -> float:
    return float(np.linalg.norm((np.linalg.inv(truth) @ found)[:3, 3]))


@pytest.mark.skipif(not (DATA / "lidar_pair").exists(), reason=f"no real data at {DATA}: set ALULA_DATA")
def test_two_real_scans_are_laid_onto_each_other_within_two_centimetres() -> None:
    found = odometry()
    for k, name in enumerate(("target", "source")):
        cloud = np.asarray(o3d.io.read_point_cloud(str(DATA / "lidar_pair" / "data" / f"{name}.ply")).points)
        step = found.add(still(k, cloud), [], np.eye(4))
    assert step.registration.believed, step.registration.refusal
    assert off(found.state.matrix, np.loadtxt(DATA / "lidar_pair" / "data" / "T_target_source.txt")) < 0.02


@pytest.mark.skipif(not (DATA / "lidar_kitti").exists(), reason=f"no real data at {DATA}: set ALULA_DATA")
@pytest.mark.parametrize("believed", [FREE, replace(FREE, autopilot_m_s=OdometrySettings().autopilot_m_s)], ids=["hardly", "as usual"])
@pytest.mark.parametrize("prior", PRIORS)
def test_a_car_is_followed_within_seven_centimetres_whatever_is_said_of_its_motion(prior, believed) -> None:
    found = odometry(believed)
    for k, row in enumerate(np.loadtxt(DATA / "lidar_kitti" / "T_first_scan.txt")):
        points = np.fromfile(DATA / "lidar_kitti" / f"{k:06d}.bin", np.float32).reshape(-1, 4)[:, :3]
        far = np.linalg.norm(points, axis=1)
        step = found.add(still(k, points[(far > 2.5) & (far < 80.0)]), [], np.eye(4), PRIORS[prior](k))
        assert step.registration.believed, step.registration.refusal
        assert off(found.state.matrix, np.vstack([row.reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])) < 0.07


@pytest.mark.skipif(not (DATA / "lidar_handheld").exists(), reason=f"no real data at {DATA}: set ALULA_DATA")
@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_sweep_in_the_hand_is_straightened_within_four_centimetres(number) -> None:
    """The inertial readings are made from another project's estimate of the motion; the points of before and after are real."""
    raw, straight = (
        np.fromfile(DATA / "lidar_handheld" / f"{kind}_{number:02d}.bin", np.float32).reshape(-1, 3) for kind in ("raw", "deskewed")
    )
    times = np.fromfile(DATA / "lidar_handheld" / f"times_{number:02d}.bin", np.float32)
    poses, moments = motion(raw, straight, times)
    found = odometry()
    speeds = np.diff(poses[:, :3, 3], axis=0) / np.diff(moments)[:, None]
    forces = np.vstack([np.zeros((1, 3)), np.diff(speeds, axis=0) / np.diff(moments)[1:, None]]) + np.array([0.0, 0.0, 9.81])
    found.filter.state = InertialState(poses[0][:3, :3], speeds[0], poses[0][:3, 3])
    found.filter.history[-1] = (0, found.filter.state)
    readings = []
    for before, after, force, moment, then in zip(poses, poses[1:], forces, moments, moments[1:], strict=False):
        rates = Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).as_rotvec() / (then - moment)
        readings.append(ImuReading(int(then * NS), rates, before[:3, :3].T @ force))
    near = np.linalg.norm(raw, axis=1) < 20.0
    step = found.add(still(0, raw[near], times[near]), readings, np.eye(4))
    apart = np.linalg.norm(step.points - straight[near], axis=1)
    assert np.sqrt(np.mean(apart**2)) < 0.04
    assert np.sqrt(np.mean(apart**2)) < 0.2 * np.sqrt(
        np.mean(np.sum((raw[near] @ poses[0][:3, :3].T + poses[0][:3, 3] - straight[near]) ** 2, axis=1))
    )


def motion(raw, straight, times):
    """Return the poses that the other project's estimate amounts to, every 5 ms from the sweep's begin to its end, and their moments.

    Rigid fits of 4 ms each, at the mean moment of their points, smoothed by a polynomial of the fourth degree.
    """
    windows = [np.abs(times - moment) < 0.002 for moment in np.arange(0.002, float(times.max()), 0.004)]
    windows = [window for window in windows if window.sum() > 50]
    fits = [rigid(raw[window], straight[window]) for window in windows]
    when = np.array([times[window].mean() for window in windows], dtype=float)
    first = fits[0][:3, :3]
    turns = Rotation.from_matrix([first.T @ fit[:3, :3] for fit in fits]).as_rotvec()
    moments = np.linspace(0.0, float(times.max()), 21)
    turn, shift = (
        np.stack([np.polyval(np.polyfit(when, values[:, k], 4), moments) for k in range(3)], axis=1)
        for values in (turns, np.array([f[:3, 3] for f in fits]))
    )
    poses = np.tile(np.eye(4), (len(moments), 1, 1))
    poses[:, :3, :3] = first @ Rotation.from_rotvec(turn).as_matrix()
    poses[:, :3, 3] = shift
    return poses, moments


def rigid(source, target) -> np.ndarray:
    """Return T_target_source, (4, 4), by least squares."""
    middle_source, middle_target = source.mean(axis=0).astype(float), target.mean(axis=0).astype(float)
    rotation, _ = Rotation.align_vectors(target - middle_target, source - middle_source)
    transform = np.eye(4)
    transform[:3, :3] = rotation.as_matrix()
    transform[:3, 3] = middle_target - rotation.apply(middle_source)
    return transform
