"""The whole procedure on flights through a yard of planes, with an autopilot whose position grows wrong."""

from __future__ import annotations

import numpy as np
import pytest
from lidar_mapping_yard import Path

from lidar_mapping import Slam, SlamSettings
from perception_core import PoseBuffer, PoseUnavailableError

LAP_S = 24.0


def lap(t):
    """Once around the yard, smoothly from rest: 12 x 6 m, 24 s a lap."""
    phase = 2 * np.pi * (t - 2.0 * (1.0 - np.exp(-t / 2.0))) / LAP_S if t > 0.0 else 0.0
    return np.array([6.0 * np.cos(phase), 3.0 * np.sin(phase), 2.0])


def fly(path, slam, seconds, **wrong) -> float:
    """Let a SLAM follow a path; return by how much its position is off at the end, metres."""
    rng = np.random.default_rng(7)
    for k in range(round(seconds * 10)):
        start_s = k / 10
        sweep = path.sweep(start_s, seed=k)
        slam.add(sweep, path.readings(start_s, start_s + 0.1, rng), path.autopilot(start_s + 0.1, **wrong), np.eye(4))
    pose, _ = slam.pose()
    return float(np.linalg.norm(pose[:3, 3] - path.position(slam._odometry.filter.stamp_ns * 1e-9)))


def off_the_yard(points) -> np.ndarray:
    x, y, z = points.T
    return np.min(np.abs([z, y - 7, y + 7, x - 10, x + 10]), axis=0)


@pytest.mark.parametrize("drift", [0.02, 0.05])
def test_the_autopilots_drift_does_not_get_into_pose_or_map(drift) -> None:
    path, slam = Path(lap, yaw=lambda t: 0.2 * np.sin(t)), Slam(SlamSettings())
    assert fly(path, slam, 6.0, drift=drift) < 0.1
    assert slam.count.rejected == 0
    large = slam.map.points[slam.map.points[:, 2] > 1.7]  # above the crates
    assert np.sqrt(np.mean(off_the_yard(large) ** 2)) < 0.04
    given = path.autopilot(6.0, drift=drift).at([int(6.0e9)]).position[0]
    there = slam.T_map_odom @ np.append(given, 1.0)
    assert there[:3] == pytest.approx(path.position(6.0), abs=0.15)


def test_a_jump_of_the_autopilots_position_moves_odom_and_not_the_map() -> None:
    path, slam = Path(lap), Slam(SlamSettings())
    assert fly(path, slam, 4.0, jump_m=2.0, jump_s=2.5) < 0.1
    assert slam.T_map_odom[0, 3] == pytest.approx(-2.0, abs=0.15)


def test_a_loop_is_closed_and_the_correction_carried_on_to_the_map() -> None:
    slam = Slam(SlamSettings())
    path = Path(lap)
    assert fly(path, slam, 20.0) < 0.1
    before, shift = slam.loops, np.array([0.0, 0.5, 0.0])
    for frame in slam.keyframes.all[len(slam.keyframes.all) // 2 :]:  # as if the second half had drifted away
        frame.pose = frame.pose.copy()
        frame.pose[:3, 3] += shift
    drifted = np.eye(4)
    drifted[:3, 3] = shift
    slam._odometry.move(drifted)
    rng = np.random.default_rng(9)
    for k in range(200, 280):
        slam.add(path.sweep(k / 10, seed=k), path.readings(k / 10, k / 10 + 0.1, rng), path.autopilot(k / 10 + 0.1), np.eye(4))
    assert slam.loops > before
    pose, _ = slam.pose()
    assert pose[:3, 3] == pytest.approx(path.position(28.0), abs=0.15)


def test_a_corridor_makes_the_position_uncertain_along_it_and_is_survived() -> None:
    path = Path(lambda t: np.array([min(t, 6.0) * 0.8, 0.0, 2.0]), corridor=True)
    slam = Slam(SlamSettings())
    assert fly(path, slam, 5.0) < 0.6
    pose, covariance = slam.pose()
    assert pose[1:3, 3] == pytest.approx([0.0, 2.0], abs=0.03)
    assert np.sqrt(covariance[0, 0]) > 10 * np.sqrt(covariance[1, 1])


def test_a_scan_that_fits_nowhere_is_not_inserted_and_seconds_of_it_are_a_lost_map() -> None:
    path, slam = Path(lap), Slam(SlamSettings())
    fly(path, slam, 1.0)
    points, rng = len(slam.map), np.random.default_rng(2)
    assert slam.problem == ""
    for k in range(10, 45):
        nonsense = path.sweep(k / 10, seed=k)
        nonsense = type(nonsense)(nonsense.stamp_ns, rng.uniform(-8, 8, nonsense.points.shape).astype(np.float32), nonsense.times_s)
        found = slam.add(nonsense, path.readings(k / 10, k / 10 + 0.1, rng), path.autopilot(k / 10 + 0.1), np.eye(4))
        assert not found.believed
    assert len(slam.map) == points
    assert "no scan fitted the map" in slam.problem
    slam.add(path.sweep(4.5, seed=45), path.readings(4.5, 4.6, rng), path.autopilot(4.6), np.eye(4))
    assert slam.problem == ""


def test_a_saved_map_is_gone_on_with() -> None:
    path, first, second = Path(lap), Slam(SlamSettings()), Slam(SlamSettings())
    fly(path, first, 3.0)
    second.resume(first.map.points)
    assert fly(path, second, 3.0) < 0.1
    assert len(second.map) < 1.3 * len(first.map)


def test_a_sweep_without_pose_changes_nothing() -> None:
    slam = Slam(SlamSettings())
    with pytest.raises(PoseUnavailableError):
        slam.add(Path(lap).sweep(0.0, seed=1), [], PoseBuffer(), np.eye(4))
    assert (len(slam.map), slam.count.scans) == (0, 0)
